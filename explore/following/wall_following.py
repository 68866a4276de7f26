"""The lowest layer: from walls to motion commands (paper, section 3.1).

Approach a wall from anywhere, follow it at a set distance to its open end, round the end, and turn back. The way is
always over floor that was seen free; the stand-off yields in narrow passages, the clearance of the body does not.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.quantities import Count, Distance, Number, Size
from chainslam.slam.robot import MotionCommand, RobotSpec, of_robot

from ..planning.navigators import NAVIGATORS, Navigation, Surveyed, Way
from ..planning.passable import PathConfig
from ..planning.paths import Planner
from ..survey.viewpoints import ViewpointsConfig
from .behaviour import Behaviour
from .driving import Pilot, spin
from .driving_config import DrivingConfig
from .surroundings import Surroundings

Following = Literal["viewpoints", "paper"]


@dataclass(frozen=True)
class FollowingConfig:
    """How the robot approaches and explores an open end."""

    robot: RobotSpec = of_robot()
    method: Following = "viewpoints"
    """How an open end is explored: from viewpoints, or by following its wall back and forth as in the paper."""
    ping_pongs: Count = 1
    """By the paper's method, a wall is given up after it was followed back and forth this often without a change of the
    map."""
    navigation: Navigation = "floor"
    """How paths are planned: over the floor seen free, or along sequences of walls in the visibility graph."""
    paths: PathConfig = field(default_factory=PathConfig)
    driving: DrivingConfig = field(default_factory=DrivingConfig)
    viewpoints: ViewpointsConfig = field(default_factory=ViewpointsConfig)
    window_m: Size = 6.0
    """A path is first searched within this distance of the robot, then along the planned walls, then on the whole
    floor."""
    moved_m: Distance = 0.2
    """An open end whose estimate moves farther than this is viewed again from the beginning."""
    tries: Number = 4
    """A viewpoint is given up once its path was blocked this often."""
    squeezes: Number = 2
    """A gap barely wider than the body is given up after this many failed attempts."""
    stall_m: Size = 9.0
    """A goal is given up if its remaining path has not become shorter within as many steps as a path of this length
    takes."""
    shorter_m: Distance = 0.02
    """Smallest decrease of the remaining path that counts as progress."""
    wider_m: Distance = 0.01
    """Additional clearance demanded of a path after each failure to drive it."""
    apart_m: Distance = 0.12
    """No view is taken from a place this close to an earlier one."""

    @property
    def stall_steps(self) -> int:
        """Steps without progress after which an errand ends."""
        return self.robot.steps_of(self.stall_m)


class Errand(ABC):
    """Drives to a sequence of places, one after the other, each given as a set of points that will do."""

    def __init__(self, config: FollowingConfig) -> None:
        self._config = config
        self._pilot: Pilot | None = None
        self._stage = 0
        self._failures = 0
        self._shortest_m, self._stalled = np.inf, 0
        self._hopeless = False
        self.looks_done = 0
        self.trouble = ""
        self.doing = ""
        self.walls_to_follow: tuple[int, ...] | None = None
        """The walls along which the navigator leads, in order; None where it asks for none."""
        self._no_way = ""

    @property
    def behaviour(self) -> Behaviour:
        """What the robot does on this errand, as one word."""
        return Behaviour.LOOK

    def command(self, around: Surroundings) -> MotionCommand | None:
        """Return the next step, or None when nothing is left to do; then `trouble` says what was in the way."""
        for _ in range(12):
            if self._hopeless:
                return None
            if self._pilot is not None and self._pilot.arrived(around.pose_world):
                self._pilot = None
                if self._arrived():
                    return spin(around, 0.5, self._config.driving)
            if self._pilot is None and not self._plan(around):
                return None
            assert self._pilot is not None
            command = self._pilot.command(around)
            if command is not None and not self._is_stalled(self._pilot.remaining_m(around.pose_world)):
                return command
            self._blocked(around)
            if command is None and self._failures:
                return MotionCommand(0.0, 0.0)  # in a tight gap the noise of one scan may leave no safe step
        return None

    def interrupt(self, around: Surroundings) -> None:
        """Look for another way: something stands in this one."""
        if self._pilot is not None:
            self._blocked(around)

    @abstractmethod
    def _plan(self, around: Surroundings) -> bool:
        """Set out for the present place or a later one; False when no way is left to any."""

    def _is_stalled(self, remaining_m: float) -> bool:
        """Take note of the way left; once it has not become shorter for long, there is no hope."""
        if remaining_m < self._shortest_m - self._config.shorter_m:
            self._shortest_m, self._stalled = remaining_m, 0
        self._stalled += 1
        self._hopeless = self._stalled > self._config.stall_steps
        if self._hopeless:
            self.trouble = f"got no nearer in {self._config.stall_steps} steps"
        return self._hopeless

    def _arrived(self) -> bool:
        """Take note that the robot stands at the present place; return whether it looks twice from there.

        A second scan, half a step of turn on, has its beams between those of the first.
        """
        self._next_stage()
        self.looks_done += 1
        return False

    def _blocked(self, around: Surroundings) -> None:
        assert self._pilot is not None
        self._failures += 1
        squeeze = self._pilot.squeeze_world(around.pose_world)
        if squeeze is not None and (self._hopeless or self._failures >= self._config.squeezes):
            around.free_space.note_too_tight(squeeze)
        self._pilot = None
        if self._failures >= self._config.tries:
            self.trouble = "the way was blocked"
            self._next_stage()

    def _next_stage(self) -> None:
        self._stage += 1
        self._failures = 0
        self._shortest_m, self._stalled = np.inf, 0

    def _planner(self, around: Surroundings, window_m: float | None) -> Planner:
        """Return a planner that keeps farther from walls after each failure."""
        paths = self._config.paths
        margin = paths.margin_m + self._config.wider_m * self._failures
        squeeze = paths.squeeze_beyond_m if self._failures < self._config.squeezes else margin
        wider = replace(paths, margin_m=margin, squeeze_beyond_m=squeeze)
        return Planner(around.free_space, around.pose_world[:2], wider, window_m, float(around.pose_world[2]))

    def _way(self, around: Surroundings, planner: Planner, places: Float[np.ndarray, "n 2"]) -> Way | None:
        """Return the way that the navigator takes to one of some places, or None."""
        navigator = NAVIGATORS[self._config.navigation]
        standoff_m, reach_m = self._config.viewpoints.standoff_m, around.scan.range_max_m
        way = navigator.way(planner, places, Surveyed(around.walls, around.graph, standoff_m, reach_m))
        if way is None and len(places):
            self._no_way = navigator.no_way
        return way

    def _drive(self, around: Surroundings, planner: Planner, places: Float[np.ndarray, "n 2"]) -> bool:
        way = self._way(around, planner, places)
        if way is None:
            return False
        self.walls_to_follow, self._no_way = way.walls, ""
        self._pilot = Pilot(way.path, way.planner, self._config.driving)
        return True


class PlaceErrand(Errand):
    """Drives to one of a set of places."""

    def __init__(self, places_world: Float[np.ndarray, "n 2"], doing: str, config: FollowingConfig) -> None:
        super().__init__(config)
        self._places = places_world
        self.doing = doing

    @property
    def behaviour(self) -> Behaviour:
        """To floor that was not seen, or to something that is no wall of the map."""
        return Behaviour.SWEEP

    def _plan(self, around: Surroundings) -> bool:
        if self._stage > 0:
            return False
        windows = (self._config.window_m, None)
        found = any(self._drive(around, self._planner(around, window), self._places) for window in windows)
        self.trouble = self.trouble if found else self.trouble or self._no_way or "no way leads there"
        return found
