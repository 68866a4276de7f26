"""The protocol that every exploration strategy keeps: from what is known to a goal and the reason for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import networkx as nx
import numpy as np
from jaxtyping import Float

from chainslam.slam.map.chains import Chain, OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap

from ..following.wall_following import FollowingConfig, Surroundings
from ..planning.driving_field import DrivingField
from ..planning.visibility_graph import followed_wall
from ..survey.frontiers import LEAST_CELLS, frontiers, pieces
from ..survey.unmapped_obstacles import obstacle_viewpoints, unmapped_obstacles
from ..survey.viewpoints import ideal_places


@dataclass(frozen=True, eq=False)
class Place:
    """Somewhere to stand; any of its points will do."""

    points_world: Float[np.ndarray, "n 2"]
    what: str
    """What it is, in words: the robot drives `to where {what}`."""
    kind: str = "unseen"
    """The kind of `Goal` that it makes."""
    about_world: Float[np.ndarray, 2] | None = None
    """What is to be seen from there, m, if it is something else than the place itself."""

    @property
    def centre_world(self) -> Float[np.ndarray, 2]:
        """What it is about, else the middle of its points, m."""
        return self.points_world.mean(axis=0) if self.about_world is None else self.about_world


@dataclass(frozen=True, kw_only=True)
class Situation:
    """What a strategy may read: the map and its covariance, the floor seen free, never the truth.

    What costs time is computed when it is first asked for.
    """

    around: Surroundings
    chains: tuple[Chain, ...]
    open_ends: tuple[OpenEnd, ...]
    """The open ends that exploration has not set aside; there may be none."""
    graph: nx.DiGraph[int]
    """The visibility graph: an edge from one wall to another means that this was seen while that was followed."""
    start_world: Float[np.ndarray, 2]
    """Where the robot began, m."""
    step: int
    """Number of the step, from 0."""
    was_in_vain: Callable[[Float[np.ndarray, 2]], bool]
    """Whether going to a place was of no use before."""
    following: FollowingConfig
    """How the robot drives to what is chosen: its paths, its places to look from."""

    @cached_property
    def current_wall(self) -> int | None:
        """Id of the wall that the robot follows."""
        return followed_wall(self.map)

    @property
    def map(self) -> StochasticMap:
        """The walls, and through `map.belief` their covariance."""
        return self.around.walls

    @cached_property
    def field(self) -> DrivingField:
        """How far it is to drive from the robot to anywhere."""
        return DrivingField(self.around.free_space, self.around.pose_world[:2], self.following.paths)

    @cached_property
    def end_metres(self) -> Float[np.ndarray, " n"]:
        """How far it is to drive to where each open end can be looked at, m; infinite where no way is known."""
        return self._end_metres(beyond_nearest=True)

    @cached_property
    def nearest_end_metres(self) -> Float[np.ndarray, " n"]:
        """The same, but only the least of them counts: any other may be infinite. Much cheaper in a large building."""
        return self._end_metres(beyond_nearest=False)

    def _end_metres(self, beyond_nearest: bool) -> Float[np.ndarray, " n"]:
        places = [ideal_places(end, self.map, self.following.viewpoints)[:2] for end in self.open_ends]
        metres = self.field.metres(np.reshape(places, (-1, 2)), beyond_nearest)
        return metres.reshape(-1, 2).min(axis=1)

    @cached_property
    def frontiers(self) -> tuple[Place, ...]:
        """The frontiers between floor that can be driven to and floor never seen, the useless ones left out."""
        return self._places(frontiers(self.around.free_space, self.field))

    @cached_property
    def frontiers_near(self) -> tuple[Place, ...]:
        """Pieces of those frontiers that lie near to the robot: a fraction of the cost in a large building."""
        borders = frontiers(self.around.free_space, self.field, only_near=True)
        return self._places([piece for border in borders for piece in pieces(border) if len(piece) >= LEAST_CELLS])

    def _places(self, borders: list[np.ndarray]) -> tuple[Place, ...]:
        places = (Place(border, "unseen floor is left") for border in borders)
        return tuple(place for place in places if not self.was_in_vain(place.centre_world))

    @cached_property
    def unmapped_obstacles(self) -> tuple[Place, ...]:
        """Where to stand before each thing that stopped beams and is no wall of the map, the useless ones left out."""
        floor = self.around.free_space
        things = [thing for thing in unmapped_obstacles(floor, self.map) if not self.was_in_vain(thing.mean(axis=0))]
        places = [(obstacle_viewpoints(thing, self.field), thing) for thing in things]
        what = "something stands that is no wall of the map"
        return tuple(Place(spots, what, "unexplained", thing.mean(axis=0)) for spots, thing in places if len(spots))


def _always(around: Surroundings) -> bool:
    return True


@dataclass(frozen=True)
class Choice:
    """Where to go and why."""

    target: OpenEnd | Place
    reason: str
    holds: Callable[[Surroundings], bool] = _always
    """Asked at every step on the way: the goal is dropped once it answers no. (An end that is no longer open is dropped
    anyway.)"""


@runtime_checkable
class Strategy(Protocol):
    """Chooses where to explore next; it may keep a memory between choices."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the choice, or None where there is nothing it would drive to now."""
        ...


@runtime_checkable
class Watchful(Strategy, Protocol):
    """A strategy that looks at every step, and not only where it is to choose."""

    def watch(self, around: Surroundings) -> None:
        """Take note of one more scan."""
        ...
