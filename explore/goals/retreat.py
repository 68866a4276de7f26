"""Back along its own way: where the body touched something, and where no way leads on that the robot knows."""

from __future__ import annotations

from dataclasses import replace

import networkx as nx
import numpy as np
from jaxtyping import Float

from slam.map.chains import Chain
from slam.robot import MotionCommand, Odometry

from ..floor.accumulated_returns import returns
from ..floor.floor_memory import FloorMemory
from ..floor.touches import Touches
from ..following.driving import keeps_clear
from ..following.wall_following import FollowingConfig, Surroundings
from ..goal import Goal, LeftPlace, SetAside
from ..outcome import Outcome
from ..planning.driving_field import DrivingField
from ..planning.paths import Planner, cells_within
from .decider import Decider

TOUCHED_BACK_M = 0.1
"""So far the robot backs out from what it touched, ..."""
LOCKED_BACK_M = 1.0
"""... and so far where it believed itself locked in."""
LAST_M = 2.0
"""A robot that cannot drive back along so much of its way is locked in."""
NEAR_M = 0.3
"""It is back if it gets so near: the wheels tell the way no better."""
WAY_SHARE = 0.9
"""Where it could drive to less of all its way, the floor contradicts the map: it begins the floor anew."""
ROUNDS = 8
"""So often at most, and never twice within `LAST_M` of way."""


class Retreat:
    """Leaves all to another decider but the way back; undoes what the wheels reported, step by step."""

    def __init__(self, inner: Decider, floor: FloorMemory, config: FollowingConfig) -> None:
        self._inner, self._floor, self._config = inner, floor, config
        self._driven: list[MotionCommand] = []
        self._touches = Touches()
        self._back_m, self._why = 0.0, ""
        self._step, self._rounds, self._since_m = -1, 0, np.inf
        self._locked, self._was_back = False, False
        self.needs_floor = inner.needs_floor

    @property
    def set_aside(self) -> dict[tuple[int, int], SetAside]:
        """The ends that exploration gave up."""
        return self._inner.set_aside

    @property
    def still_open(self) -> tuple[SetAside, ...]:
        """Those of them that are open still."""
        return self._inner.still_open

    @property
    def left_places(self) -> tuple[LeftPlace, ...]:
        """The borders of unseen floor that were to be visited, and what was in the way."""
        return self._inner.left_places

    @property
    def goal(self) -> Goal | None:
        """The open end or the place that the robot is about."""
        return self._inner.goal

    @property
    def walls_to_follow(self) -> tuple[int, ...]:
        """The walls along which the goal is approached."""
        return self._inner.walls_to_follow

    @property
    def doing(self) -> str:
        """What the robot is about, in words."""
        return f"back along its way ({self._why})" if self._why else self._inner.doing

    @property
    def outcome(self) -> Outcome:
        """Why there is nothing left to do."""
        return Outcome.FAILED if self._locked else self._inner.outcome

    @property
    def closing_words(self) -> str:
        """The same in words."""
        return f"locked in at step {self._step}" if self._locked else self._inner.closing_words

    def interrupt(self, around: Surroundings) -> None:
        """Pass on that the robot is not where its errand left it."""
        self._inner.interrupt(around)

    def start_over(self) -> None:
        """Pass on that the floor is another one."""
        self._inner.start_over()

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of what the wheels reported of a command, and whether the body touched something."""
        self._since_m += float(np.hypot(*odometry.motion[:2]))
        self._touches.move(odometry, command)
        self._was_back = bool(self._why)
        if not self._was_back:
            self._driven.append(_arc_of(odometry))

    def command(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> MotionCommand | None:
        """Return the next step, or None at the end."""
        self._step += 1
        if not self.needs_floor:
            return self._inner.command(around, chains, graph)
        if self._touches.is_new:
            self._note_touch(around)
        back = self._back(around)
        if back is not None:
            return back
        around = replace(around, touched_robot=self._touches.points_robot)
        command = self._inner.command(around, chains, graph)
        if command is not None:
            return command
        if self._rounds >= ROUNDS or self._since_m < LAST_M or self._knows_its_way(around):
            self._locked = not self._leads_back(around)
            return None
        self._rounds, self._since_m = self._rounds + 1, 0.0
        self._floor.begin_anew(around.walls)
        self._inner.start_over()
        self._back_m, self._why = LOCKED_BACK_M, "no way led on where it had driven"
        back = self._back(around)
        return back if back is not None else self._inner.command(around, chains, graph)

    def _note_touch(self, around: Surroundings) -> None:
        """Make an obstacle of what the body met, and turn back; a touch on the way back ends that."""
        places = self._touches.meet(self._points(around))
        self._floor.note_touched(around.pose_world, places)
        self._inner.interrupt(around)
        self._back_m, self._why = TOUCHED_BACK_M, "" if self._was_back else "the body touched something"

    def _back(self, around: Surroundings) -> MotionCommand | None:
        """Return the step that undoes the last one; None where that is done, or where something has come in between."""
        if self._why and self._driven and self._back_m > 0.0:
            last = self._driven.pop()
            self._back_m -= abs(last.forward_m)
            command = MotionCommand(-last.forward_m, -last.turn_rad)
            if keeps_clear(command, self._points(around), self._config.driving):
                return command
        self._why = ""
        return None

    def _points(self, around: Surroundings) -> Float[np.ndarray, "n 2"]:
        """Return what stands in the way back, robot frame, m."""
        return np.concatenate([returns(around.scan), around.recent_robot])

    def _knows_its_way(self, around: Surroundings) -> bool:
        """Return whether the floor leads back along the last metres, and to all but a little of the way before."""
        if not self._leads_back(around):
            return False
        way = self._floor.way_world()
        metres = DrivingField(around.free_space, around.pose_world[:2], self._config.paths).metres(way)
        return bool(np.isfinite(metres).mean() >= WAY_SHARE)

    def _leads_back(self, around: Surroundings) -> bool:
        """Return whether the robot stands on floor that it knows, and can drive back along its last metres."""
        floor, here = around.free_space, around.pose_world[:2]
        cell = floor.cells(here[None])[0]
        if not floor.evidence[tuple(cell)] < 0:
            return False
        far = self._floor.last_way_world(around.pose_world, LAST_M)[-1]
        planner = Planner(floor, here, self._config.paths, self._config.window_m)
        return planner.to(floor.points(cells_within(floor, far, NEAR_M))) is not None


def _arc_of(odometry: Odometry) -> MotionCommand:
    """Return the arc that the wheels reported, as a command."""
    x, y, turn = odometry.motion.tolist()
    chord = x * np.cos(0.5 * turn) + y * np.sin(0.5 * turn)
    return MotionCommand(float(chord / np.sinc(0.5 * turn / np.pi)), turn)
