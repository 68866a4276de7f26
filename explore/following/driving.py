"""From a path to one safe motion command: the first of the cheapest whole steps to a horizon, by what the scans show."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import arc, to_world, wrap
from chainslam.slam.robot import MotionCommand, Scan
from chainslam.slam.robot.body import reaches_m, rim_of

from ..floor.accumulated_returns import returns, steadied
from ..floor.free_space import FreeSpace
from ..planning.field import Field
from ..planning.paths import Path, Planner
from .driving_config import DrivingConfig
from .motion_kernels import Motions, cells_ahead, cost_of_plan, metres_at, search

_NOTHING = np.zeros((0, 2))
_NO_PLAN = np.zeros(0, dtype=np.int64)
_RIM = np.stack([np.cos(np.arange(24) * np.pi / 12), np.sin(np.arange(24) * np.pi / 12)], axis=-1)
"""Points of the rim of a disc of radius one, every fifteen degrees."""
SHARES = (1.0, 1.0 / 3.0, 0.13)
"""Of the longest step: the lengths that are tried, forwards and backwards ..."""
TURNS = (0.0, 0.5, -0.5, 1.0, -1.0)
"""... each with these shares of the widest turn, which are tried on the spot, too."""
SWING_SIGMAS = 2.0
"""So far the farthest corner of an outline swings out where the wheels slip."""
ON_THE_WAY = np.array([0.25, 0.5, 0.75, 1.0])
"""Where on a step its clearance is looked at: 4 cm apart, a return reaches in by a millimetre more at most."""


class Controller:
    """Drives down a field, a few whole steps planned ahead."""

    def __init__(self, config: DrivingConfig) -> None:
        self._config = config
        self._plan = _NO_PLAN

    def command(
        self,
        pose_world: Float[np.ndarray, "3"],
        points_robot: Float[np.ndarray, "m 2"],
        field: Field,
        free_space: FreeSpace,
    ) -> MotionCommand | None:
        """Return the next step, or None where no safe one leads on.

        The plan is kept until it is short or not safe any more, or another is cheaper by `better_m`.
        """
        config, (commands, motions) = self._config, motions_of(self._config)
        points = to_world(points_robot, pose_world) if len(points_robot) else _NOTHING
        plan = self._plan
        cost_m = cost_of_plan(pose_world, plan, points, motions, field) if len(plan) else np.inf
        if len(plan) < config.short or not np.isfinite(cost_m):
            apart = np.array([config.apart_m, 0.5 * config.robot.turn_rad])
            found, _ = search(
                pose_world, points, motions, field, config.horizon_m, apart, config.gain_m
            )
            new_m = cost_of_plan(pose_world, found, points, motions, field) if len(found) else np.inf
            if new_m < cost_m - config.better_m or not np.isfinite(cost_m):
                plan = found
        if not len(plan):
            self._plan = _NO_PLAN
            return None
        command, self._plan = commands[plan[0]], plan[1:]
        bold = careful(command, pose_world, free_space, config)
        if bold is not command:
            self._plan = _NO_PLAN
        return bold


class Pilot:
    """Drives along one path."""

    def __init__(self, path: Path, planner: Planner, config: DrivingConfig) -> None:
        self._planner, self._config = planner, config
        self._field = planner.field(path.points_world)
        self._controller = Controller(config)
        self.destination_world = path.points_world[-1]
        """Where the path ends, m."""
        self._ahead_world = path.points_world
        self.remaining_m = np.inf
        """What is left of the way, m, a metre in a narrow place for more."""

    @property
    def squeeze_world(self) -> Float[np.ndarray, "2"] | None:
        """Where, within the next half metre of the path, there is hardly room for the body; None if nowhere."""
        ahead = self._ahead_world[:10]
        tight = np.flatnonzero(~self._planner.has_room(ahead))
        return ahead[tight[len(tight) // 2]] if len(tight) else None

    def arrived(self, pose_world: Float[np.ndarray, "3"]) -> bool:
        """Return whether the robot stands at the end of the path."""
        x, y, heading = pose_world
        self.remaining_m = float(metres_at(x, y, heading, self._field))
        ahead = cells_ahead(x, y, 20, self._field)
        self._ahead_world = self._field.corner_world + (ahead[:, ::-1] + 0.5) * self._field.cell_m
        return len(ahead) > 0 and bool(self._field.metres[*ahead[0], 0] <= 0.0)

    def is_obstructed(self, pose_world: Float[np.ndarray, "3"], scan: Scan) -> bool:
        """Return whether a return of this scan lies on the next metre of the path."""
        # What is beside the robot already is no matter of the path: `command` gets away from it.
        ahead = self._ahead_world
        ahead = ahead[np.hypot(*(ahead - pose_world[:2]).T) > self._config.robot.step_m]
        points = to_world(returns(scan, self._config.robot.scanner), pose_world)
        gap = ahead[:, None] - points
        return bool(gap.size) and float(np.hypot(gap[..., 0], gap[..., 1]).min()) < self._config.obstructed_m

    def command(
        self,
        pose_world: Float[np.ndarray, "3"],
        scan: Scan,
        free_space: FreeSpace,
        recent_robot: Float[np.ndarray, "r 2"] = _NOTHING,
        touched_robot: Float[np.ndarray, "t 2"] = _NOTHING,
    ) -> MotionCommand | None:
        """Return the next step along the path, or None where no safe one leads on."""
        points = obstacles(scan, recent_robot, touched_robot, self._config)
        return self._controller.command(pose_world, points, self._field, free_space)


def obstacles(
    scan: Scan, recent_robot: Float[np.ndarray, "r 2"], touched_robot: Float[np.ndarray, "t 2"], config: DrivingConfig
) -> Float[np.ndarray, "m 2"]:
    """Return what the body keeps clear of, robot frame, m: returns, the mean of those of the last scans where they
    agree, those out of the view of this one, and what the body touched.
    """
    points = steadied(scan, recent_robot, config.robot)
    if not scan.is_full_turn and len(recent_robot):
        scanner = config.robot.scanner
        off = recent_robot - scanner.pose_robot[:2]
        bearing = wrap(np.arctan2(off[:, 1], off[:, 0]) - scanner.heading_rad)
        out = (bearing < scan.bearings_rad[0] - scan.step_rad) | (bearing > scan.bearings_rad[-1] + scan.step_rad)
        points = np.concatenate([points, recent_robot[out]])
    return np.concatenate([points, touched_robot])


@lru_cache(maxsize=16)
def motions_of(config: DrivingConfig) -> tuple[tuple[MotionCommand, ...], Motions]:
    """Return the steps that a robot takes, and what each of them covers and costs."""
    robot = config.robot
    ways = [s * robot.step_m for share in SHARES for s in ((share, -share) if robot.can_reverse else (share,))]
    commands = tuple(
        MotionCommand(way, turn * robot.turn_rad) for way in (0.0, *ways) for turn in TURNS if way or turn
    )
    forward, turn = np.array([[each.forward_m, each.turn_rad] for each in commands]).T
    places = np.array([[arc(s * f, s * t) for s in ON_THE_WAY] for f, t in zip(forward, turn, strict=True)])
    wheel_m = np.abs(forward) * np.where(forward < 0.0, config.back, 1.0) + 0.5 * robot.wheels.base_m * np.abs(turn)
    clear_m = config.clear_m + config.clear_share * np.maximum(
        np.abs(forward), 0.5 * robot.wheels.base_m * np.abs(turn)
    )
    if robot.outline_m is not None:
        slip = [np.sqrt(robot.wheels.over_arc(f, t).cov[2, 2]) for f, t in zip(forward, turn, strict=True)]
        clear_m += SWING_SIGMAS * (robot.radius_m - robot.half_width_m) * np.array(slip)
    turn_m = 0.5 * (0.5 * robot.wheels.base_m + config.step_cost_m / robot.turn_rad)
    metre = 1.0 + config.step_cost_m / robot.step_m
    motions = Motions(
        np.ascontiguousarray(places), wheel_m + config.step_cost_m, clear_m, config.wide_m, config.rest * turn_m,
        float(config.back if robot.can_reverse else 1e9), config.rest * metre,
        np.array(robot.outline_m or _NOTHING, dtype=np.float64), float(robot.radius_m),
    )  # fmt: skip
    return commands, motions


def keeps_clear(command: MotionCommand, points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig) -> bool:
    """Return whether the body comes to cover nothing that it does not cover now: enough on a way that it came."""
    least_m = config.radius_m + config.clear_m
    beside = points_robot[reaches_m(points_robot, config.robot) > least_m]
    c_s = (arc(share * command.forward_m, share * command.turn_rad) for share in ON_THE_WAY)
    gaps = (reaches_m((beside - at[:2]) @ _turned(at[2]), config.robot).min(initial=np.inf) for at in c_s)
    return min(gaps) >= least_m


def _turned(angle_rad: float) -> Float[np.ndarray, "2 2"]:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s], [s, c]])


def careful(
    command: MotionCommand, pose_world: Float[np.ndarray, "3"], free_space: FreeSpace, config: DrivingConfig
) -> MotionCommand:
    """Shorten a step whose end would cover floor that was not seen yet."""
    x, y, turn = arc(command.forward_m, command.turn_rad)
    c, s = np.cos(pose_world[2]), np.sin(pose_world[2])
    end = pose_world[:2] + np.array([c * x - s * y, s * x + c * y])
    rim = config.radius_m * _RIM if config.robot.outline_m is None else rim_of(config.robot, pose_world[2] + turn)
    if abs(command.forward_m) > config.slow_m and np.any(free_space.unknown_at(end + rim)):
        share = config.slow_m / abs(command.forward_m)
        return MotionCommand(share * command.forward_m, share * command.turn_rad)
    return command
