"""The protocol of exploration strategies: from the present knowledge to a goal and the reason for it."""

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

from ..following.surroundings import Surroundings
from ..following.wall_following import FollowingConfig
from ..planning.driving_field import DrivingField
from ..planning.visibility_graph import followed_wall
from ..survey.frontiers import frontiers
from ..survey.unmapped_obstacles import obstacle_viewpoints, unmapped_obstacles
from ..survey.viewpoints import ideal_places


@dataclass(frozen=True, eq=False)
class Place:
    """A goal that is reached at any one of its points."""

    points_world: Float[np.ndarray, "n 2"]
    what: str
    """Completes the sentence "to where ...", which describes the goal."""
    kind: str = "unseen"
    """Kind of the goal in reports."""
    about_world: Float[np.ndarray, 2] | None = None
    """Position of what is viewed from there, m, if it is not the place itself."""

    @property
    def centre_world(self) -> Float[np.ndarray, 2]:
        """Position of what is viewed, or the middle of the points, m."""
        return self.points_world.mean(axis=0) if self.about_world is None else self.about_world


@dataclass(frozen=True, kw_only=True)
class Situation:
    """What a strategy may read: the map with its covariance and the free floor, but never the truth.

    Costly properties are computed when they are first used.
    """

    around: Surroundings
    chains: tuple[Chain, ...]
    open_ends: tuple[OpenEnd, ...]
    """The open ends that are not blacklisted; there may be none."""
    graph: nx.DiGraph[int]
    """The visibility graph: an edge leads from a wall to one that was seen while the robot followed it."""
    start_world: Float[np.ndarray, 2]
    """Position of the start, m."""
    step: int
    """Index of the step, from 0."""
    was_in_vain: Callable[[Float[np.ndarray, 2]], bool]
    """Whether earlier visits to a place brought nothing."""
    following: FollowingConfig
    """Settings by which the robot drives to its goals and views them."""

    @cached_property
    def current_wall(self) -> int | None:
        """Id of the wall that the robot follows."""
        return followed_wall(self.map)

    @property
    def map(self) -> StochasticMap:
        """The walls; `map.belief` has their covariance."""
        return self.around.walls

    @cached_property
    def field(self) -> DrivingField:
        """Driving distances from the robot to all reachable floor."""
        return DrivingField(self.around.free_space, self.around.pose_world[:2], self.following.paths)

    @cached_property
    def end_metres(self) -> Float[np.ndarray, " n"]:
        """Driving distance to a viewpoint of each open end, m; infinite if no path is known."""
        return self._end_metres(beyond_nearest=True)

    @cached_property
    def nearest_end_metres(self) -> Float[np.ndarray, " n"]:
        """As `end_metres`, but only the smallest distance is exact: much cheaper in a large building."""
        return self._end_metres(beyond_nearest=False)

    def _end_metres(self, beyond_nearest: bool) -> Float[np.ndarray, " n"]:
        places = [ideal_places(end, self.map, self.following.viewpoints)[:2] for end in self.open_ends]
        metres = self.field.metres(np.reshape(places, (-1, 2)), beyond_nearest)
        return metres.reshape(-1, 2).min(axis=1)

    @cached_property
    def frontiers(self) -> tuple[Place, ...]:
        """Frontiers between reachable and unseen floor, without those that were visited in vain."""
        borders = frontiers(self.around.free_space, self.field)
        places = (Place(border, "unseen floor is left") for border in borders)
        return tuple(place for place in places if not self.was_in_vain(place.centre_world))

    @cached_property
    def unmapped_obstacles(self) -> tuple[Place, ...]:
        """Viewpoints of each obstacle that is no wall of the map, without those that were visited in vain."""
        floor = self.around.free_space
        things = [thing for thing in unmapped_obstacles(floor, self.map) if not self.was_in_vain(thing.mean(axis=0))]
        places = [(obstacle_viewpoints(thing, self.field), thing) for thing in things]
        what = "something stands that is no wall of the map"
        return tuple(Place(spots, what, "unexplained", thing.mean(axis=0)) for spots, thing in places if len(spots))


def _always(around: Surroundings) -> bool:
    return True


@dataclass(frozen=True)
class Choice:
    """A goal and the reason for it."""

    target: OpenEnd | Place
    reason: str
    holds: Callable[[Surroundings], bool] = _always
    """Called at every step; the goal is dropped once this returns False, or its end is no longer open."""


@runtime_checkable
class Strategy(Protocol):
    """Chooses where to explore next; it may keep a state between choices."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the next goal, or None if there is none at present."""
        ...


@runtime_checkable
class Watchful(Strategy, Protocol):
    """A strategy that is called at every step, not only for a choice."""

    def watch(self, around: Surroundings) -> None:
        """Take in one more scan."""
        ...
