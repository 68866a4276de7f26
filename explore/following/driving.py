"""From a path to one safe motion command: the first of the cheapest whole steps to a horizon, by what scans show."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import arc, to_world, wrap
from chainslam.slam.robot import MotionCommand, RobotSpec
from chainslam.slam.robot.body import reaches_m, rim_of

from ..floor.accumulated_returns import steadied
from ..planning.paths import Field, Path
from .driving_config import DrivingConfig
from .motion_kernels import Motions, after, clearance_m, is_at_end, next_steps, step_room_m
from .surroundings import Surroundings

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
        self._config, self._plan = config, _NO_PLAN
        self._commands, self._motions = motions_of(config)

    def command(self, around: Surroundings, field: Field) -> MotionCommand | None:
        """Return the next step, or None where no safe one leads on."""
        config, pose, unseen = self._config, around.pose_world, out_of_view(around, self._config)
        points, unseen = to_world(obstacles(around, config), pose), to_world(unseen, pose) if len(unseen) else unseen
        plan = next_steps(pose, self._plan, points, unseen, self._motions, field, config.better_m)
        self._plan = plan[1:]
        return self._careful(int(plan[0]), around) if len(plan) else None

    def _careful(self, step: int, around: Surroundings) -> MotionCommand:
        """Return the command of a step, shortened where its end would cover floor that was not seen yet."""
        config, command = self._config, self._commands[step]
        if abs(command.forward_m) > config.careful_m:
            end = after(around.pose_world, step, self._motions)
            rim = config.radius_m * _RIM if config.robot.outline_m is None else rim_of(config.robot, end[2])
            if around.free_space.unknown_at(end[:2] + rim).any():
                share = config.careful_m / abs(command.forward_m)
                return MotionCommand(share * command.forward_m, share * command.turn_rad)
        return command


class Pilot:
    """Drives along one path."""

    def __init__(self, path: Path, config: DrivingConfig) -> None:
        self._field = path.field
        self._controller = Controller(config)
        self.destination_world = path.points_world[-1]
        """Where the path ends, m."""

    def arrived(self, pose_world: Float[np.ndarray, "3"]) -> bool:
        """Return whether the robot stands where nothing is left of the way."""
        return is_at_end(pose_world[0], pose_world[1], self._field)

    def command(self, around: Surroundings) -> MotionCommand | None:
        """Return the next step along the path, or None where no safe one leads on."""
        return self._controller.command(around, self._field)


def obstacles(around: Surroundings, config: DrivingConfig) -> Float[np.ndarray, "m 2"]:
    """Return what the body keeps clear of: what the last scans hit and what it touched, robot frame, m."""
    return np.concatenate([steadied(around.scan, around.recent_robot, config.robot), around.touched_robot])


def out_of_view(around: Surroundings, config: DrivingConfig) -> Float[np.ndarray, "u 2"]:
    """Return places beside the body that no scan has shown and the scanner does not look at now, robot frame, m."""
    scan, robot = around.scan, config.robot
    if scan.is_full_turn:
        return _NOTHING
    last, first = scan.bearings_rad[-1], scan.bearings_rad[0]
    places = _beside(robot, around.free_space.config.cell_m)
    scanner = robot.scanner.pose_robot
    bearings = wrap(np.arctan2(places[:, 1] - scanner[1], places[:, 0] - scanner[0]) - scanner[2])
    places = places[np.abs(wrap(bearings - 0.5 * (first + last))) > 0.5 * (last - first)]
    return places[around.free_space.unknown_at(to_world(places, around.pose_world))]


@lru_cache(maxsize=16)
def _beside(robot: RobotSpec, cell_m: float) -> Float[np.ndarray, "n 2"]:
    """Return places beside the body as far as a step leads, a cell apart, m, robot frame."""
    far_m = robot.radius_m + robot.step_m
    axis = np.arange(-far_m, far_m, cell_m)
    places = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    off_m = reaches_m(places, robot) - robot.radius_m
    return places[(off_m > 0.0) & (off_m < robot.step_m)]


def spin(around: Surroundings, share: float, config: DrivingConfig) -> MotionCommand:
    """Return the turn on the spot nearest to a share of the widest for which the body has room; none without any."""
    (commands, motions), here = motions_of(config), np.zeros(3)
    points = np.concatenate([obstacles(around, config), out_of_view(around, config)])
    now_m = clearance_m(0.0, 0.0, 0.0, points, motions, motions.wide_m)
    turns = [a for a, each in enumerate(commands) if each.forward_m == 0.0]
    for a in sorted(turns, key=lambda a: abs(commands[a].turn_rad - share * config.robot.turn_rad)):
        if step_room_m(here, a, now_m, points, motions) > -np.inf:
            return commands[a]
    return MotionCommand(0.0, 0.0)


@lru_cache(maxsize=16)
def motions_of(config: DrivingConfig) -> tuple[tuple[MotionCommand, ...], Motions]:
    """Return the steps that a robot takes, and what each of them covers and costs."""
    robot = config.robot
    ways = [s * robot.step_m for share in SHARES for s in ((share, -share) if robot.can_reverse else (share,))]
    commands = tuple(MotionCommand(way, turn * robot.turn_rad) for way in (0.0, *ways) for turn in TURNS if way or turn)
    forward, turn = np.array([[each.forward_m, each.turn_rad] for each in commands]).T
    places = np.array([[arc(s * f, s * t) for s in ON_THE_WAY] for f, t in zip(forward, turn, strict=True)])
    wheel_m = np.abs(forward) * np.where(forward < 0.0, config.back, 1.0) + 0.5 * robot.wheels.base_m * np.abs(turn)
    error_m: float | Float[np.ndarray, " a"] = config.clear_m
    if robot.outline_m is not None:  # errors of returns and of the turn are independent
        slip = [np.sqrt(robot.wheels.over_arc(f, t).cov[2, 2]) for f, t in zip(forward, turn, strict=True)]
        error_m = np.hypot(error_m, SWING_SIGMAS * (robot.radius_m - robot.half_width_m) * np.array(slip))
    clear_m = error_m + config.clear_share * np.maximum(np.abs(forward), 0.5 * robot.wheels.base_m * np.abs(turn))
    step_m, turn_m = config.step_cost_m, 0.5 * robot.wheels.base_m
    motions = Motions(
        places=places,
        costs_m=wheel_m + step_m,
        clear_m=clear_m,
        is_short=(forward != 0.0) & (np.abs(forward) <= config.careful_m + 1e-9),
        wide_m=config.wide_m,
        horizon_m=config.horizon * robot.step_m,
        apart_m=robot.step_m / 12.0,
        apart_rad=0.5 * robot.turn_rad,
        metre_m=config.rest * (1.0 + step_m / robot.step_m),
        turn_m=config.rest * 0.5 * (turn_m + step_m / robot.turn_rad),
        back_m=config.rest * (config.back - 1.0) if robot.can_reverse else 1e9,
        corners_m=np.array(robot.outline_m or _NOTHING, dtype=np.float64),
        radius_m=float(robot.radius_m),
    )
    return commands, motions


def keeps_clear(command: MotionCommand, points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig) -> bool:
    """Return whether the body comes to cover nothing that it does not cover now: enough on a way that it came."""
    beside = points_robot[reaches_m(points_robot, config.robot) > config.radius_m + config.clear_m]
    ways = [arc(share * command.forward_m, share * command.turn_rad) for share in ON_THE_WAY]
    motions = motions_of(config)[1]
    return all(clearance_m(x, y, heading, beside, motions, 1.0) >= config.clear_m for x, y, heading in ways)
