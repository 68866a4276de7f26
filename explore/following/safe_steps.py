"""One motion command that is safe by the raw returns: towards an aim, through a gap, or away from a wall."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import J, arc
from chainslam.slam.robot import MotionCommand, RobotSpec
from chainslam.slam.robot.body import reaches_m

from .driving_config import DrivingConfig

GAIN_SHARE = 0.2
"""Such a step leads out if the gap grows by this share of it: less is noise of the ranges."""
NEAR_M = 0.1
"""Returns farther off than a step, the body and this are not in the way of a step."""
AWAY_RAD = 0.17
"""A step that leads away from a return turns by this, or not."""
FACING_RAD = 0.02
"""A turn of less is not worth a step."""


def turn_towards(aim_robot: Float[np.ndarray, "2"], config: DrivingConfig) -> float:
    """Return the turn towards an aim, rad, no more than the robot turns in one step."""
    return float(np.clip(np.arctan2(aim_robot[1], aim_robot[0]), -config.robot.turn_rad, config.robot.turn_rad))


def step_towards(
    aim_robot: Float[np.ndarray, "2"], points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig, narrow: bool
) -> MotionCommand | None:
    """Return a safe step towards the aim, a turn on the spot where it lies far to one side; None where none is safe."""
    way = 1.0
    if (
        narrow and aim_robot[0] < 0.0 and config.robot.can_reverse
    ):  # each turn on the spot slips aside by a millimetre or two: it backs out
        aim_robot, way = -aim_robot, -1.0
    error, distance = float(np.arctan2(aim_robot[1], aim_robot[0])), float(np.hypot(aim_robot[0], aim_robot[1]))
    turn = turn_towards(aim_robot, config)
    if abs(error) > (config.narrow_spin_rad if narrow else config.spin_rad):
        spin = MotionCommand(0.0, turn)
        return spin if config.robot.outline_m is None or is_safe(spin, points_robot, config, narrow) else None
    forward = min(config.robot.step_m * (1.0 - 0.8 * abs(error) / config.spin_rad), distance)
    if narrow:
        forward = min(forward, config.slow_m)
    for share in (1.0, 0.5, 0.25):
        command = MotionCommand(way * share * forward, turn)
        if is_safe(command, points_robot, config, narrow):
            return command
    return None


def step_away(points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig) -> MotionCommand | None:
    """Return a short step, forwards or backwards, that leads out of the margin of a return; None outside of it."""
    gaps = reaches_m(points_robot, config.robot)
    if not len(gaps) or gaps.min() > config.radius_m + 2.0 * config.margin_m:
        return None
    ways = (config.slow_m, -config.slow_m) if config.robot.can_reverse else (config.slow_m,)
    turn_rad = min(AWAY_RAD, config.robot.turn_rad)
    commands = [MotionCommand(way, turn) for way in ways for turn in (-turn_rad, 0.0, turn_rad)]
    ends = np.stack([arc(command.forward_m, command.turn_rad) for command in commands])
    least = _reaches_at(ends, points_robot, config.robot).min(axis=1)
    best = int(np.argmax(least))
    leads_out = least[best] > gaps.min() + GAIN_SHARE * config.slow_m and is_safe(
        commands[best], points_robot, config, narrow=False
    )
    return commands[best] if leads_out else None


def centred(
    aim_robot: Float[np.ndarray, "2"], points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig
) -> tuple[Float[np.ndarray, "2"], float, bool]:
    """Return the aim, the gap between the returns on both sides, m, and whether it is narrow and the body fits.

    There the aim is moved to the middle. The gap is infinite where there are returns on one side at most.
    """
    distance = float(np.hypot(aim_robot[0], aim_robot[1]))
    ahead = aim_robot / max(distance, 1e-9)
    along, sideways = points_robot @ ahead, points_robot @ (J @ ahead)
    beside = (along > -config.beside_m) & (along < distance + config.beside_m)
    left, right = points_robot[beside & (sideways > 0)], points_robot[beside & (sideways < 0)]
    if distance < 1e-9 or not len(left) or not len(right):
        return aim_robot, np.inf, False
    # The nearest two stand straight across the gap, however the way slants.
    gaps = np.hypot(*(left[:, None] - right).transpose(2, 0, 1))
    k, m = divmod(int(np.argmin(gaps)), len(right))
    gap = float(gaps[k, m])
    middle, through = 0.5 * (left[k] + right[m]), J.T @ (left[k] - right[m]) / gap
    if gap >= config.narrow_m or (gap <= config.fits_m and abs(through @ middle) > config.within_m):
        return aim_robot, gap, False
    return middle + max(through @ (aim_robot - middle), config.beside_m - through @ middle) * through, gap, True


def keeps_clear(command: MotionCommand, points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig) -> bool:
    """Return whether the body comes to cover nothing that it does not cover now: enough on a way that it came."""
    least_m = config.radius_m + config.least_margin_m
    beside = points_robot[reaches_m(points_robot, config.robot) > least_m]
    return least_gap(command, beside, config.robot) >= least_m


def least_gap(command: MotionCommand, points_robot: Float[np.ndarray, "m 2"], robot: RobotSpec) -> float:
    """Return the least distance m from the middle of the body to any point on the way, as of a disc."""
    places = np.stack([arc(share * command.forward_m, share * command.turn_rad) for share in (0.25, 0.5, 0.75, 1)])
    return float(_reaches_at(places, points_robot, robot).min(initial=np.inf))


def _reaches_at(
    places: Float[np.ndarray, "n 3"], points_robot: Float[np.ndarray, "m 2"], robot: RobotSpec
) -> Float[np.ndarray, "n m"]:
    """Return how far the body is from points at each of some places on its way; a disc needs not turn for that."""
    gap = points_robot - places[:, None, :2]
    if robot.outline_m is None:
        return reaches_m(gap, robot)
    c, s = np.cos(places[:, 2, None]), np.sin(places[:, 2, None])
    ahead = np.stack([c * gap[..., 0] + s * gap[..., 1], c * gap[..., 1] - s * gap[..., 0]], axis=-1)
    return reaches_m(ahead, robot)


def is_safe(
    command: MotionCommand, points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig, narrow: bool
) -> bool:
    """Return whether the body keeps its margin on the way, or at least comes no nearer to any return."""
    if not len(points_robot):
        return True
    near = points_robot[
        np.hypot(points_robot[:, 0], points_robot[:, 1]) < config.radius_m + config.robot.step_m + NEAR_M
    ]
    if not len(near):
        return True
    least = least_gap(command, near, config.robot)
    now = float(reaches_m(near, config.robot).min())
    margin = config.margin_m
    if narrow:  # deep in a gap hardly wider than the body, a step along it may take some of what little is left
        left = now - config.radius_m - config.give_m
        margin = max(min(config.narrow_margin_m, left), config.least_margin_m)
    return least >= config.radius_m + margin or (least >= now and least > config.radius_m)
