"""Back along its own way: where the body touched something, and where no way leads on that the robot knows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import networkx as nx
import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.geometry.quantities import Distance, Number, Share, Size
from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import MotionCommand, Odometry, RobotSpec, of_robot

from ..floor.accumulated_returns import returns
from ..floor.floor_memory import FloorMemory
from ..floor.touches import Touches
from ..following.behaviour import Behaviour
from ..following.driving import keeps_clear
from ..following.surroundings import Surroundings
from ..following.wall_following import FollowingConfig
from ..outcome import Outcome
from ..planning.driving_field import DrivingField
from ..planning.paths import Planner
from ..planning.sight import cells_within
from .decider import Decider, Decision


@dataclass(frozen=True)
class RetreatConfig:
    """How the robot backs out where it is locked in, and when it begins its floor grid anew."""

    robot: RobotSpec = of_robot()
    locked_back_m: Distance = 1.0
    """Distance that the robot backs out where it believed itself locked in."""
    last_m: Size = 2.0
    """A robot that cannot drive back along this much of its path is locked in."""
    near_m: Distance = 0.3
    """Distance from a place on its path within which the robot counts as back there."""
    way_share: Share = 0.9
    """If the robot has no goal left and could drive to less than this share of its path, it begins the grid anew."""
    rounds: Number = 8
    """How often the grid may be begun anew in one run; in between the robot must have driven `last_m`."""

    @property
    def touched_back_m(self) -> float:
        """So far the robot backs out from what it touched: half a radius of the body."""
        return 0.5 * self.robot.radius_m


class Retreat:
    """Leaves all to another decider but the way back; undoes what the odometry reported, step by step."""

    def __init__(self, inner: Decider, floor: FloorMemory, config: RetreatConfig, following: FollowingConfig) -> None:
        self._inner, self._floor, self._config, self._following = inner, floor, config, following
        self._driven: list[Odometry] = []
        self._touches = Touches(config.robot)
        self._back_m, self._why = 0.0, ""
        self._step, self._rounds, self._since_m = -1, 0, np.inf
        self._was_back = False
        self._decided = Decision(None, "")

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of what the odometry reported of a command, and whether the body touched something."""
        self._since_m += float(np.hypot(*odometry.motion[:2]))
        self._touches.move(odometry, command)
        self._was_back = bool(self._why)
        if not self._was_back:
            self._driven.append(odometry)

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return what to do next: back out of a touch, what the inner decider says, or back where that is no way."""
        self._step += 1
        if self._touches.is_new:
            self._note_touch(around)
        back = self._back(around)
        if back is not None:
            return back
        if len(touched := self._touches.points_robot):
            around = replace(around, touched_robot=touched)
        self._decided = self._inner.decide(around, chains, graph)
        if self._decided.command is not None:
            return self._decided
        if self._rounds >= self._config.rounds or self._since_m < self._config.last_m or self._knows_its_way(around):
            if self._leads_back(around):
                return self._decided
            return replace(self._decided, words=f"locked in at step {self._step}", outcome=Outcome.FAILED)
        self._rounds, self._since_m = self._rounds + 1, 0.0
        self._floor.begin_anew(around.pose_world)
        self._inner.start_over()
        self._decided = Decision(None, "")
        self._back_m, self._why = self._config.locked_back_m, "no way led on where it had driven"
        back = self._back(around)
        if back is None:
            self._decided = self._inner.decide(around, chains, graph)
        return back or self._decided

    def _note_touch(self, around: Surroundings) -> None:
        """Make an obstacle of what the body met, and turn back; a touch on the way back ends that."""
        places = self._touches.meet(self._points(around))
        for place in to_world(places, around.pose_world):
            around.free_space.note_touched(place)
        self._inner.interrupt(around)
        self._back_m, self._why = self._config.touched_back_m, "" if self._was_back else "the body touched something"

    def _back(self, around: Surroundings) -> Decision | None:
        """Return the step that undoes the last one; None where that is done, or where something has come in between."""
        if self._why and self._driven and self._back_m > 0.0:
            last = _arc_of(self._driven.pop())
            self._back_m -= abs(last.forward_m)
            command = MotionCommand(-last.forward_m, -last.turn_rad)
            may = command.forward_m >= 0.0 or self._config.robot.can_reverse
            if may and keeps_clear(command, self._points(around), self._following.driving):
                words = f"back along its way ({self._why})"
                return replace(self._decided, command=command, words=words, behaviour=Behaviour.RETREAT)
        self._why = ""
        return None

    def _points(self, around: Surroundings) -> Float[np.ndarray, "n 2"]:
        """Return what stands in the way back, robot frame, m."""
        return np.concatenate([returns(around.scan, self._config.robot.scanner), around.recent_robot])

    def _knows_its_way(self, around: Surroundings) -> bool:
        """Return whether the floor leads back along the last metres, and to all but a little of the way before."""
        if not self._leads_back(around):
            return False
        way = self._floor.way_world()
        metres = DrivingField(around.free_space, around.pose_world[:2], self._following.paths).metres(way)
        return bool(np.isfinite(metres).mean() >= self._config.way_share)

    def _leads_back(self, around: Surroundings) -> bool:
        """Return whether the robot stands on floor that it knows, and can drive back along its last metres."""
        floor, here = around.free_space, around.pose_world[:2]
        cell = floor.cells(here[None])[0]
        if not floor.evidence[tuple(cell)] < 0:
            return False
        far = self._floor.last_way_world(around.pose_world, self._config.last_m)[-1]
        planner = Planner(floor, here, self._following.paths, self._following.window_m, float(around.pose_world[2]))
        return planner.to(floor.points(cells_within(floor, far, self._config.near_m))) is not None


def _arc_of(odometry: Odometry) -> MotionCommand:
    """Return the arc that the odometry reported, as a command."""
    x, y, turn = odometry.motion.tolist()
    chord = x * np.cos(0.5 * turn) + y * np.sin(0.5 * turn)
    return MotionCommand(float(chord / np.sinc(0.5 * turn / np.pi)), turn)
