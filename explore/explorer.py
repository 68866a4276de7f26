"""The top layer: which open end next, when to abandon it, what was given up and why (paper, section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import networkx as nx
import numpy as np
from jaxtyping import Float

from slam.chains import Chain, OpenEnd
from slam.robot import MotionCommand

from .goal import Goal, SetAside
from .looks import ideal_places, places_near
from .navigation import route
from .paths import Planner
from .strategies import Situation, Strategy
from .unseen import unseen_borders
from .visibility import followed_wall
from .wall_following import EndErrand, Errand, FollowingConfig, PlaceErrand, Surroundings


@dataclass(frozen=True)
class ExplorerConfig:
    """When an end is given up, and for how long."""

    following: FollowingConfig = field(default_factory=FollowingConfig)
    moved_m: float = 0.2
    """An end that was set aside is tried again when it has moved this far."""
    attempts: int = 3
    """So many ends set aside at one place (within 0.3 m) are enough: it is not tried again."""
    patience_steps: int = 400
    """A goal that takes longer is set aside."""
    second_looks: int = 4
    """Before it ends, the robot turns on the spot this often while there are walls that it saw only once."""
    sweep: bool = True
    """After the last chain, visit what is reachable and unseen."""


class Explorer:
    """Holds the present goal and the memory of what was given up."""

    def __init__(self, strategy: Strategy, start_world: Float[np.ndarray, 2], config: ExplorerConfig) -> None:
        self._strategy, self._start, self._config = strategy, start_world, config
        self._errand: Errand | None = None
        self._steps_on_goal = 0
        self._attempts: list[Float[np.ndarray, 2]] = []
        self._unreached: dict[tuple[int, int], int] = {}
        self._skipped_places: list[Float[np.ndarray, 2]] = []
        self.set_aside: dict[tuple[int, int], SetAside] = {}
        self._looked_again = 0
        self._open: frozenset[tuple[int, int]] = frozenset()
        self.needs_floor = True
        self.goal: Goal | None = None
        self.walls_to_follow: tuple[int, ...] = ()

    @property
    def doing(self) -> str:
        """What the robot is about, in words."""
        return self._errand.doing if self._errand is not None else ""

    @property
    def still_open(self) -> tuple[SetAside, ...]:
        """The ends that were set aside and are open still."""
        return tuple(aside for key, aside in self.set_aside.items() if key in self._open)

    @property
    def closing_words(self) -> str:
        """Why there is nowhere left to go."""
        left = len(self.still_open)
        return "every chain is closed" if not left else f"no reachable open end is left; {left} cannot be closed"

    def command(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> MotionCommand | None:
        """Return the next step, or None when there is nowhere left to go."""
        ends = {(end.wall, end.side): end for chain in chains for end in chain.open_ends}
        self._open = frozenset(ends)
        self._revive(ends)
        self._abandon(ends)
        for _ in range(len(ends) + 20):
            if self._errand is None and not self._choose(around, chains, ends, graph):
                return self._look_again(around)
            assert self._errand is not None
            self._steps_on_goal += 1
            command = self._errand.command(around)
            if command is not None and self._steps_on_goal <= self._config.patience_steps:
                self._looked_again = 0
                return command
            self._give_up(around, ends)
        return None

    def _look_again(self, around: Surroundings) -> MotionCommand | None:
        """Turn on the spot while there are walls that were seen only once; None when there is nothing left to do."""
        self._looked_again += 1
        if self._looked_again > self._config.second_looks or not around.walls.tentative.any():
            return None
        return MotionCommand(0.0, self._config.following.driving.turn_rad)

    def _revive(self, ends: dict[tuple[int, int], OpenEnd]) -> None:
        """Forget what was set aside where the end is gone or has moved: there it may be tried again."""
        for key, aside in list(self.set_aside.items()):
            end = ends.get(key)
            if end is None or self._is_hopeless(end.position_world):
                continue
            if np.hypot(*(end.position_world - aside.position_world)) > self._config.moved_m:
                del self.set_aside[key]

    def _abandon(self, ends: dict[tuple[int, int], OpenEnd]) -> None:
        """Drop the goal if it is no longer an open end; a place to look at, as soon as there is an end to explore."""
        if isinstance(self._errand, EndErrand):
            end = ends.get((self._errand.end.wall, self._errand.end.side))
            if end is None or (end.wall, end.side) in self.set_aside:
                self._errand = self.goal = None
            else:
                self._errand.follow(end)
        elif self._errand is not None and self._candidates(ends):
            self._errand = self.goal = None

    def _candidates(self, ends: dict[tuple[int, int], OpenEnd]) -> list[OpenEnd]:
        return [end for key, end in ends.items() if key not in self.set_aside]

    def _choose(
        self,
        around: Surroundings,
        chains: tuple[Chain, ...],
        ends: dict[tuple[int, int], OpenEnd],
        graph: nx.DiGraph[int],
    ) -> bool:
        self._steps_on_goal = 0
        candidates = self._candidates(ends)
        if candidates:
            followed = followed_wall(around.walls)
            situation = Situation(
                around.walls, chains, tuple(candidates), self._start, followed,
                lambda some: self._nearest(around, some),
            )  # fmt: skip
            choice = self._strategy.choose(situation)
            if choice is None:
                # No ideal place is known yet for any end: go where the straight way is shortest and see.
                gaps = [np.hypot(*(end.position_world - around.pose_world[:2])) for end in candidates]
                end, reason = candidates[int(np.argmin(gaps))], "no way to stand before any open end is known; nearest"
            else:
                end, reason = choice.end, choice.reason
            self.walls_to_follow = route(graph, followed, end.wall)
            self._errand = EndErrand(end, self.walls_to_follow, self._config.following)
            self.goal = Goal("open-end", end.wall, end.side, end.position_world, reason)
            return True
        return self._sweep(around)

    def _nearest(self, around: Surroundings, ends: Sequence[OpenEnd]) -> tuple[int, float] | None:
        """Which end can be stood before after the shortest drive, and how far that is, m."""
        following = self._config.following
        for window in (following.window_m, None):
            planner = Planner(around.free_space, around.pose_world[:2], following.paths, window)
            places, owners = [], []
            for row, end in enumerate(ends):
                if window is not None and np.max(np.abs(end.position_world - around.pose_world[:2])) > window:
                    continue
                for ideal in ideal_places(end, around.walls, following.looks)[:2]:
                    found = places_near(ideal, end, around.free_space, planner, following.looks)[:1]
                    places.append(found)
                    owners += [row] * len(found)
            path = planner.to(np.concatenate(places)) if owners else None
            if path is not None:
                return owners[path.reached], path.cost
        return None

    def _sweep(self, around: Surroundings) -> bool:
        """Go to the nearest floor that borders on unseen floor."""
        if not self._config.sweep and len(around.walls):
            return False
        borders = unseen_borders(around.free_space, around.pose_world[:2], self._config.following.paths)
        borders = [b for b in borders if not self._was_skipped(b.mean(axis=0))]
        if not borders:
            return False
        places = np.concatenate(borders)
        why = "unseen floor is left" if len(around.walls) else "no wall is in sight yet"
        self._errand = PlaceErrand(places, f"to where {why}", self._config.following)
        nearest = places[int(np.argmin(np.hypot(*(places - around.pose_world[:2]).T)))]
        self.goal = Goal("unseen", None, None, nearest, f"{why}: {len(borders)} borders of seen floor")
        self.walls_to_follow = ()
        return True

    def _was_skipped(self, place: Float[np.ndarray, 2]) -> bool:
        return sum(np.hypot(*(place - other)) < 0.3 for other in self._skipped_places) >= 2

    def _give_up(self, around: Surroundings, ends: dict[tuple[int, int], OpenEnd]) -> None:
        """Set the goal aside with the reason."""
        errand = self._errand
        assert errand is not None
        self._errand = self.goal = None
        if not isinstance(errand, EndErrand):
            if errand.trouble or errand.looks_done == 0 or self._steps_on_goal > self._config.patience_steps:
                self._skipped_places.append(around.pose_world[:2].copy())
            return
        end = errand.end
        if self._steps_on_goal > self._config.patience_steps:
            reason = f"not reached in {self._config.patience_steps} steps"
        elif errand.looks_done:
            reason = f"still open after {errand.looks_done} looks"
        else:
            reason = errand.trouble
        self.set_aside[end.wall, end.side] = SetAside(end.wall, end.side, end.position_world, reason)
        self._attempts.append(end.position_world)

    def _is_hopeless(self, place: Float[np.ndarray, 2]) -> bool:
        return sum(np.hypot(*(place - other)) < 0.3 for other in self._attempts) >= self._config.attempts
