"""From a path to one safe motion command; safe by the raw scan, also where the map is wrong."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from slam.geometry.poses import J, arc, to_robot
from slam.robot import MotionCommand, RobotSpec, Scan, of_robot

from ..floor.accumulated_returns import returns, steadied
from ..floor.free_space import FreeSpace
from ..planning.paths import Path, Planner

_NOTHING = np.zeros((0, 2))


@dataclass(frozen=True)
class DrivingConfig:
    """How fast one step goes, and how near to a return it may bring the disc."""

    robot: RobotSpec = of_robot()
    spin_rad: float = float(np.deg2rad(30.0))
    """With more than this to turn, the robot turns on the spot first."""
    lookahead_m: float = 0.6
    """How far ahead on its path the robot aims; half as far, and half again, where no step towards that is safe ..."""
    least_lookahead_m: float = 0.15
    """... but no less than this, ..."""
    short_points: int = 8
    """... for so many points of the path, 0.05 m apart."""
    margin_m: float = 0.02
    """Least distance kept between disc and returns, unless the step leads away from them."""
    careful_m: float = 0.05
    """Longest step onto floor that was not seen yet."""
    narrow_beyond_m: float = 0.15
    """Where returns on both sides of the way leave less than this beside the body, the robot aims for the middle,
    slowly ..."""
    narrow_margin_m: float = 0.01
    """... keeps at least this from them, ..."""
    narrow_spin_rad: float = float(np.deg2rad(4.0))
    """... turns on the spot first with more than this to turn, ..."""
    give_m: float = 0.003
    """Where less than that is left between two sides already, a step may take this much of it, ..."""
    least_margin_m: float = 0.004
    """... down to this. Beside a lone return there is room: that much is below a range's noise."""
    fits_beyond_m: float = 0.025
    """... and does not try where they leave less than this beside the body: returns tell the width to a centimetre.
    Where it stands between the two, it does fit: """
    within_m: float = 0.05
    """the line from one to the other passes so near to the robot's middle."""
    beside_m: float = 0.1
    """Beside the way are returns from this far behind the robot to this far beyond its aim."""
    obstructed_within_m: float = 0.03
    """A return nearer to the path ahead than the radius less this is in the way, since the path keeps to a grid."""
    arrived_m: float = 0.08
    """The end of the path counts as reached within this."""

    @property
    def radius_m(self) -> float:
        """The robot's disc."""
        return self.robot.radius_m

    @property
    def narrow_m(self) -> float:
        """A gap between returns of less than this is narrow."""
        return self.robot.beyond(self.robot.radius_m + self.narrow_beyond_m)

    @property
    def fits_m(self) -> float:
        """The body does not fit through a gap of less."""
        return self.robot.beyond(self.robot.radius_m + self.fits_beyond_m)

    @property
    def obstructed_m(self) -> float:
        """A return this near to the path ahead is in the way."""
        return self.robot.beyond(-self.obstructed_within_m)

    @property
    def slow_m(self) -> float:
        """Longest careful step: no longer than any."""
        return min(self.careful_m, self.robot.step_m)


class Pilot:
    """Drives along one path."""

    def __init__(self, path: Path, planner: Planner, config: DrivingConfig) -> None:
        self._points = path.points_world
        self._planner, self._config = planner, config
        self._at = 0
        self._lookahead_m, self._full_again_at = config.lookahead_m, 0

    @property
    def remaining_m(self) -> float:
        """Length of the path from the nearest point on it to its end."""
        ahead = np.diff(self._points[self._at :], axis=0)
        return float(np.sum(np.hypot(ahead[:, 0], ahead[:, 1])))

    @property
    def destination_world(self) -> Float[np.ndarray, "2"]:
        """Where the path ends, m."""
        return self._points[-1]

    @property
    def squeeze_world(self) -> Float[np.ndarray, "2"] | None:
        """Where, within the next half metre of the path, there is hardly room for the body; None if nowhere."""
        ahead = self._points[self._at : self._at + 10]
        tight = np.flatnonzero(~self._planner.has_room(ahead))
        return ahead[tight[len(tight) // 2]] if len(tight) else None

    def arrived(self, pose_world: Float[np.ndarray, "3"]) -> bool:
        """Return whether the robot stands at the end of the path."""
        return float(np.hypot(*(self._points[-1] - pose_world[:2]))) < self._config.arrived_m

    def is_obstructed(self, pose_world: Float[np.ndarray, "3"], scan: Scan) -> bool:
        """Return whether a return of this scan lies on the next metre of the path."""
        ahead = self._points[self._at : self._at + 20]
        # What is beside the robot already is no matter of the path: `command` gets away from it.
        ahead = ahead[np.hypot(*(ahead - pose_world[:2]).T) > self._config.robot.step_m]
        gap = to_robot(ahead, pose_world)[:, None] - returns(scan, self._config.robot.scanner)
        return bool(gap.size) and float(np.hypot(gap[..., 0], gap[..., 1]).min()) < self._config.obstructed_m

    def command(
        self,
        pose_world: Float[np.ndarray, "3"],
        scan: Scan,
        free_space: FreeSpace,
        recent_robot: Float[np.ndarray, "r 2"] = _NOTHING,
        touched_robot: Float[np.ndarray, "t 2"] = _NOTHING,
    ) -> MotionCommand | None:
        """Return the next step along the path, or None where no safe one leads on.

        `recent_robot` are returns of the last scans, in the robot's frame of now: they count where there is room. In
        a narrow place the noise of so many would leave none. What the body touched, `touched_robot`, always
        counts.
        """
        points, ahead = returns(scan, self._config.robot.scanner), self._aim(pose_world, self._config.lookahead_m)
        aim, gap_m, narrow = _centred(ahead, points, self._config)
        if gap_m < self._config.narrow_m:
            steady = steadied(scan, recent_robot, self._config.robot)
            aim, gap_m, narrow = _centred(ahead, steady, self._config)
        points = np.concatenate([steady if narrow else points, _NOTHING if narrow else recent_robot, touched_robot])
        if gap_m < self._config.narrow_m:
            command = _towards(aim, points, self._config, narrow)
        else:
            command = self._clear_step(ahead, pose_world, points)
        if command is not None:
            return self._careful(command, pose_world, free_space)
        if narrow and self._config.robot.can_reverse:
            back = MotionCommand(-self._config.slow_m, 0.0)
            return back if _is_safe(back, points, self._config, narrow) else None
        turn = _turn_towards(aim, self._config)
        return _away(points, self._config) or (MotionCommand(0.0, turn) if abs(turn) > FACING_RAD else None)

    def _clear_step(
        self,
        ahead_robot: Float[np.ndarray, "2"],
        pose_world: Float[np.ndarray, "3"],
        points_robot: Float[np.ndarray, "m 2"],
    ) -> MotionCommand | None:
        """Return a safe step towards the point ahead on the path, if need be a nearer one, or None where there is none.

        The straight way to it leaves the path where that bends round something; the nearer the point, the closer the
        robot keeps to the path.
        """
        lookahead_m, aim = self._config.lookahead_m, ahead_robot
        if self._at < self._full_again_at:
            lookahead_m, aim = self._lookahead_m, self._aim(pose_world, self._lookahead_m)
        while (command := _towards(aim, points_robot, self._config, narrow=False)) is None:
            if lookahead_m <= self._config.least_lookahead_m:
                return None
            lookahead_m *= 0.5
            aim = self._aim(pose_world, lookahead_m)
            self._lookahead_m, self._full_again_at = lookahead_m, self._at + self._config.short_points
        return command

    def _aim(self, pose_world: Float[np.ndarray, "3"], lookahead_m: float) -> Float[np.ndarray, "2"]:
        """Return the farthest point of the path within the lookahead to which the way is clear, robot frame, m."""
        position_world = pose_world[:2]
        gaps = np.hypot(*(self._points[self._at : self._at + 40] - position_world).T)
        self._at += int(np.argmin(gaps))
        ahead = self._points[self._at :]
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ahead, axis=0).T))])
        last = int(np.searchsorted(along, lookahead_m, side="right")) - 1
        clear = (row for row in range(last, 0, -1) if self._planner.clear_ahead(position_world, ahead[row]))
        return to_robot(ahead[next(clear, min(2, len(ahead) - 1))][None], pose_world)[0]

    def _careful(
        self, command: MotionCommand, pose_world: Float[np.ndarray, "3"], free_space: FreeSpace
    ) -> MotionCommand:
        """Shorten a step whose end would cover floor that was not seen yet."""
        x, y, _ = arc(command.forward_m, command.turn_rad)
        c, s = np.cos(pose_world[2]), np.sin(pose_world[2])
        end = pose_world[:2] + np.array([c * x - s * y, s * x + c * y])
        if np.any(free_space.unknown_at(end + self._config.radius_m * _RIM)):
            return MotionCommand(min(command.forward_m, self._config.slow_m), command.turn_rad)
        return command


_RIM = np.stack([np.cos(np.arange(24) * np.pi / 12), np.sin(np.arange(24) * np.pi / 12)], axis=-1)
"""Points of the rim of a disc of radius one, every fifteen degrees."""
GAIN_SHARE = 0.2
"""Such a step leads out if the gap grows by this share of it: less is noise of the ranges."""
NEAR_M = 0.1
"""Returns farther off than a step, the body and this are not in the way of a step."""
AWAY_RAD = 0.17
"""A step that leads away from a return turns by this, or not."""
FACING_RAD = 0.02
"""A turn of less is not worth a step."""


def _turn_towards(aim_robot: Float[np.ndarray, "2"], config: DrivingConfig) -> float:
    return float(np.clip(np.arctan2(aim_robot[1], aim_robot[0]), -config.robot.turn_rad, config.robot.turn_rad))


def _towards(
    aim_robot: Float[np.ndarray, "2"], points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig, narrow: bool
) -> MotionCommand | None:
    """Return a safe step towards the aim, a turn on the spot where it lies far to one side; None where none is safe."""
    way = 1.0
    if (
        narrow and aim_robot[0] < 0.0 and config.robot.can_reverse
    ):  # each turn on the spot slips aside by a millimetre or two: it backs out
        aim_robot, way = -aim_robot, -1.0
    error, distance = float(np.arctan2(aim_robot[1], aim_robot[0])), float(np.hypot(aim_robot[0], aim_robot[1]))
    turn = _turn_towards(aim_robot, config)
    if abs(error) > (config.narrow_spin_rad if narrow else config.spin_rad):
        return MotionCommand(0.0, turn)
    forward = min(config.robot.step_m * (1.0 - 0.8 * abs(error) / config.spin_rad), distance)
    if narrow:
        forward = min(forward, config.slow_m)
    for share in (1.0, 0.5, 0.25):
        command = MotionCommand(way * share * forward, turn)
        if _is_safe(command, points_robot, config, narrow):
            return command
    return None


def _away(points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig) -> MotionCommand | None:
    """Return a short step, forwards or backwards, that leads out of the margin of a return; None outside of it."""
    gaps = np.hypot(points_robot[:, 0], points_robot[:, 1])
    if not len(gaps) or gaps.min() > config.radius_m + 2.0 * config.margin_m:
        return None
    ways = (config.slow_m, -config.slow_m) if config.robot.can_reverse else (config.slow_m,)
    turn_rad = min(AWAY_RAD, config.robot.turn_rad)
    commands = [MotionCommand(way, turn) for way in ways for turn in (-turn_rad, 0.0, turn_rad)]
    ends = np.stack([arc(command.forward_m, command.turn_rad)[:2] for command in commands])
    gap = points_robot - ends[:, None]
    least = np.hypot(gap[..., 0], gap[..., 1]).min(axis=1)
    best = int(np.argmax(least))
    leads_out = least[best] > gaps.min() + GAIN_SHARE * config.slow_m and _is_safe(
        commands[best], points_robot, config, narrow=False
    )
    return commands[best] if leads_out else None


def _centred(
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
    """Return whether the disc comes to cover nothing that it does not cover now: enough on a way that it came."""
    least_m = config.radius_m + config.least_margin_m
    beside = points_robot[np.hypot(points_robot[:, 0], points_robot[:, 1]) > least_m]
    return _least_gap(command, beside) >= least_m


def _least_gap(command: MotionCommand, points_robot: Float[np.ndarray, "m 2"]) -> float:
    """Return the least distance m from the middle of the body to any point on the way."""
    places = np.stack([arc(share * command.forward_m, share * command.turn_rad)[:2] for share in (0.25, 0.5, 0.75, 1)])
    gap = points_robot - places[:, None]
    return float(np.hypot(gap[..., 0], gap[..., 1]).min(initial=np.inf))


def _is_safe(
    command: MotionCommand, points_robot: Float[np.ndarray, "m 2"], config: DrivingConfig, narrow: bool
) -> bool:
    """Return whether the disc keeps its margin on the way, or at least comes no nearer to any return."""
    if not len(points_robot):
        return True
    near = points_robot[
        np.hypot(points_robot[:, 0], points_robot[:, 1]) < config.radius_m + config.robot.step_m + NEAR_M
    ]
    if not len(near):
        return True
    least = _least_gap(command, near)
    now = float(np.hypot(near[:, 0], near[:, 1]).min())
    margin = config.margin_m
    if narrow:  # deep in a gap hardly wider than the body, a step along it may take some of what little is left
        left = now - config.radius_m - config.give_m
        margin = max(min(config.narrow_margin_m, left), config.least_margin_m)
    return least >= config.radius_m + margin or (least >= now and least > config.radius_m)
