"""The paper's three layers over one goal: a wall to explore, the walls that lead there, and the one that is followed.

Exploration gives a wall that is the end of a chain, navigation turns it into a sequence of walls over the visibility
graph, and the following layer takes one wall after the other (paper, figure 3).
"""

from __future__ import annotations

from collections.abc import Container

import numpy as np

from chainslam.slam.map.chains import HEAD, TAIL, OpenEnd
from chainslam.slam.robot import MotionCommand

from ..planning.lanes import lanes_of
from ..planning.paths import Planner
from ..planning.visibility_graph import followed_wall
from ..planning.wall_routes import sequence
from .behaviour import Behaviour
from .surroundings import Surroundings
from .wall_follower import WallFollower
from .wall_following import FollowingConfig


class PaperErrand:
    """Leads to a wall and along it, to and fro, until its chain goes on or the map no longer changes."""

    looks_done = 0

    def __init__(self, end: OpenEnd, config: FollowingConfig) -> None:
        self.end = end
        self._config = config
        self._walls: tuple[int, ...] = ()
        self._follower: WallFollower | None = None
        self._closed: set[tuple[int, int]] = set()
        self._known: frozenset[int] = frozenset()
        self._begun = 0
        self.trouble = ""

    @property
    def walls_to_follow(self) -> tuple[int, ...]:
        """The walls that are followed one after the other, the goal last."""
        return self._walls

    @property
    def behaviour(self) -> Behaviour:
        """What the following layer does."""
        return Behaviour.APPROACH if self._follower is None else self._follower.behaviour

    @property
    def doing(self) -> str:
        """What the following layer does, in words."""
        return "" if self._follower is None else self._follower.doing

    def is_open(self, ends: Container[tuple[int, int]]) -> bool:
        """Return whether the wall still is the first or the last of its chain."""
        return (self.end.wall, TAIL) in ends or (self.end.wall, HEAD) in ends

    def command(self, around: Surroundings) -> MotionCommand | None:
        """Return the next step; None once the wall cannot be reached or brings nothing new, told in `trouble`."""
        self._note_change(around)
        while True:
            walls = self._navigate(around)
            if self._follower is None or self._follower.wall != walls[0]:
                self._follower = WallFollower(walls[0], self._side(walls, around), self._config)
                self._begun = 0
            command = None if self._is_done() else self._follower.command(around)
            if command is not None:
                return command
            if len(walls) == 1:
                times = self._config.ping_pongs
                self.trouble = (
                    self._follower.trouble or f"nothing new on {times} way{'s' * (times > 1)} to and fro along it"
                )
                return None
            self._closed.add((walls[0], walls[1]))
            self._walls, self._follower = (), None

    def interrupt(self, around: Surroundings) -> None:
        """Turn back: something stands in the way."""
        if self._follower is not None:
            self._follower.interrupt(around)

    def _is_done(self) -> bool:
        assert self._follower is not None
        return self._follower.ping_pongs - self._begun >= self._config.ping_pongs

    def _note_change(self, around: Surroundings) -> None:
        """Begin to count anew where the map has changed: a wall has come or gone, or the end has moved."""
        known = frozenset(around.walls.ids[~around.walls.tentative].tolist())
        moved = False
        if self.end.wall in known:
            now = around.walls.ends_world[around.walls.belief.rows([self.end.wall])[0], self.end.side]
            moved = bool(np.hypot(*(now - self.end.position_world)) > self._config.moved_m)
            if moved:
                self.end = OpenEnd(self.end.wall, self.end.side, now)
        if self._follower is not None and (moved or known != self._known):
            self._begun = self._follower.ping_pongs
        self._known = known

    def _navigate(self, around: Surroundings) -> tuple[int, ...]:
        """Return the walls to follow from here: the rest of those planned, or others where these no longer lead on."""
        goal = self.end.wall
        if self._config.navigation == "floor":
            self._walls = (goal,)
        elif self._walls[-1:] != (goal,) or not all(wall in around.walls.ids for wall in self._walls):
            # A wall that was seen where none was followed has no edge: it is approached over the floor seen free.
            self._walls = sequence(around.graph, self._near(around), goal, self._closed) or (goal,)
        elif len(self._walls) > 1:
            planner = self._planner(around)
            for k in range(len(self._walls) - 1, 0, -1):
                if self._is_near(self._walls[k], around, planner):
                    self._walls = self._walls[k:]
                    break
        return self._walls

    def _near(self, around: Surroundings) -> list[int]:
        """Return the walls to which a straight way leads over the floor seen free; else the one beside the robot."""
        walls, planner = around.walls, self._planner(around)
        in_reach = walls.ids[(walls.distances_m <= around.scan.range_max_m) & ~walls.tentative]
        near = [int(wall) for wall in in_reach if self._is_near(int(wall), around, planner)]
        beside = followed_wall(walls, np.inf)
        return near or ([] if beside is None else [beside])

    def _is_near(self, wall: int, around: Surroundings, planner: Planner) -> bool:
        lanes = lanes_of(wall, around.walls, planner, self._config.viewpoints.standoff_m)
        stops = np.concatenate([np.zeros((0, 2)), *(lane.stops_world for lane in lanes)])
        here = np.broadcast_to(around.pose_world[:2], stops.shape)
        return bool(np.any(planner.passable_lines(here, stops)))

    def _planner(self, around: Surroundings) -> Planner:
        return Planner(around.free_space, around.pose_world[:2], self._config.paths, self._config.window_m)

    def _side(self, walls: tuple[int, ...], around: Surroundings) -> int | None:
        """Return the end of the first wall to go to first: the open one of the goal, else that nearer to the next."""
        if len(walls) == 1:
            return self.end.side
        first, then = around.walls.ends_world[around.walls.belief.rows(list(walls[:2]))]
        gaps = np.hypot(*(first - then.mean(axis=0)).T)
        return TAIL if gaps[TAIL] < gaps[HEAD] else HEAD
