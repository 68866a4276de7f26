"""The lowest layer: from walls to motion commands (paper, section 3.1).

Approach a wall from anywhere, follow it at a set distance to its open end, round the end, and turn back. The way is
always over floor that was seen free; the stand-off yields in narrow passages, the clearance of the body does not.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.quantities import Count, Distance, Number, Size
from chainslam.slam.robot import MotionCommand, RobotSpec, of_robot

from ..planning.passable import PathConfig
from ..planning.paths import Planner
from ..planning.wall_sequence import WallSearch
from ..survey.viewpoints import ViewpointsConfig
from .behaviour import Behaviour
from .driving import Pilot, spin
from .driving_config import DrivingConfig
from .surroundings import Surroundings

Navigation = Literal["floor", "visibility"]
Following = Literal["viewpoints", "paper"]
NO_WALLS = "no sequence of walls leads there"
"""Why a place on floor that hangs together with the robot's may yet be out of reach."""


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
    """A path is first searched within this distance of the robot, then on the whole floor."""
    moved_m: Distance = 0.2
    """An open end whose estimate moves farther than this is viewed again from the beginning."""
    tries: Number = 4
    """A viewpoint is given up once its path was blocked this often."""
    apart_m: Distance = 0.12
    """No view is taken from a place this close to an earlier one."""


class Errand(ABC):
    """Drives to a sequence of places, one after the other, each given as a set of points that will do."""

    def __init__(self, config: FollowingConfig) -> None:
        self._config = config
        self._pilot: Pilot | None = None
        self._stage = 0
        self._failures = 0
        self.looks_done = 0
        self.trouble = ""
        self.doing = ""
        self.walls_to_follow: tuple[int, ...] = ()
        """The walls along which the way leads, in order; none over the floor."""
        self._no_way = ""

    @property
    def behaviour(self) -> Behaviour:
        """What the robot does on this errand, as one word."""
        return Behaviour.LOOK

    def command(self, around: Surroundings) -> MotionCommand | None:
        """Return the next step, or None when nothing is left to do; then `trouble` says what was in the way."""
        for _ in range(12):
            if self._pilot is not None and self._pilot.arrived(around.pose_world):
                self._pilot = None
                if self._arrived():
                    return spin(around, 0.5, self._config.driving)
            if self._pilot is None and not self._plan(around):
                return None
            assert self._pilot is not None
            command = self._pilot.command(around)
            if command is not None:
                return command
            self.interrupt(around)
            if self._failures:
                return MotionCommand(0.0, 0.0)  # in a tight gap the noise of one scan may leave no safe step
        return None

    def interrupt(self, around: Surroundings) -> None:
        """Look for another way: something stands in this one."""
        if self._pilot is None:
            return
        self._failures += 1
        self._pilot = None
        if self._failures >= self._config.tries:
            self.trouble = "the way was blocked"
            self._next_stage()

    @abstractmethod
    def _plan(self, around: Surroundings) -> bool:
        """Set out for the present place or a later one; False when no way is left to any."""

    def _arrived(self) -> bool:
        """Take note that the robot stands at the present place; return whether it looks twice from there.

        A second scan, half a step of turn on, has its beams between those of the first.
        """
        self._next_stage()
        self.looks_done += 1
        return False

    def _next_stage(self) -> None:
        self._stage += 1
        self._failures = 0

    def _planner(self, around: Surroundings, window_m: float | None) -> Planner:
        """Return a planner of the floor as it is now."""
        x, y, heading = around.pose_world
        return Planner(around.free_space, np.array([x, y]), self._config.paths, window_m, float(heading))

    def _drive(self, around: Surroundings, planner: Planner, places: Float[np.ndarray, "n 2"]) -> bool:
        """Set out for one of some places by the way that the navigation takes; return whether there is one."""
        walls: tuple[int, ...] = ()
        if self._config.navigation == "visibility":
            standoff_m, reach_m = self._config.viewpoints.standoff_m, around.scan.range_max_m
            found = WallSearch(around.graph, around.walls, planner, standoff_m, reach_m).to(places)
            path = None if found is None else planner.within(found.cells).to(places)
            walls = () if found is None else found.walls
            self._no_way = NO_WALLS if path is None and len(places) else ""
        else:
            path = planner.to(places) if len(places) else None
        if path is None:
            return False
        self.walls_to_follow = walls
        self._pilot = Pilot(path, self._config.driving)
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
