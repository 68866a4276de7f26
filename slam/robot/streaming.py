"""A robot that streams, made into one that steps: scans come by the clock, motion goes on until it is stopped."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ..geometry.poses import inverse, wrap
from .messages import MotionCommand, Odometry, Scan, without_near
from .spec import RobotError

KNOTS = 9
"""Times during a scan at which the odometry is asked; between them the motion is even."""
AT_REST = 1e-5
"""A scanner that moves by less, m and rad, while it turns, stands still."""
NEAREST_STEPS = 1.5
"""A direction in which no beam was taken within so many beam steps is not known."""
ONE_FACE = 0.2
"""Neighbouring returns whose ranges differ by less than this share of the nearer are of one face."""
SHARE_MOVED, TRIES = 0.1, 3
"""A robot that goes less than this share of its commands, so many times in turn, does not move."""


@dataclass(frozen=True)
class TimedScan:
    """One turn of the range finder as its driver gives it: beams one after another, while the robot may move."""

    bearings_rad: Float[np.ndarray, " k"]
    """In the order in which the beams were taken, evenly spaced, ascending or descending."""
    ranges_m: Float[np.ndarray, " k"]
    """As in `Scan`: +inf where nothing came back, NaN where the beam tells nothing."""
    sigma_m: float
    range_max_m: float
    start_s: float
    """When the first beam was taken, on the robot's clock."""
    end_s: float
    """When the last one was."""
    range_min_m: float = 0.0
    """Returns below this tell nothing."""
    sigma_share: float = 0.0
    """As in `Scan`: standard deviation as a share of the range, beside `sigma_m`."""


@dataclass(frozen=True)
class Twist:
    """What the motors are to do until told otherwise."""

    speed_m_s: float
    turn_rad_s: float


@runtime_checkable
class StreamingRobot(Protocol):
    """A robot whose scans, odometry and motors go on by themselves."""

    def scan(self) -> TimedScan:
        """Wait for the next scan and return it."""
        ...

    def odometry(self, from_s: float, to_s: float) -> Odometry:
        """Return the motion between two times, in the robot's frame at the first."""
        ...

    def send(self, twist: Twist) -> None:
        """Drive like this from now on."""
        ...

    def stop(self) -> None:
        """Stand still."""
        ...


class SteppedRobot:
    """Makes `sense` and `drive` of a streaming robot (`Robot`); it stands still between two steps.

    A command takes whole turns of the scanner. Whatever goes wrong, the robot is stopped first. Raises RobotError once
    it was told to go and did not move, three times in turn.
    """

    def __init__(self, robot: StreamingRobot, speed_m_s: float = 0.2, turn_rad_s: float = 0.6) -> None:
        self._robot = robot
        self._speed_m_s, self._turn_rad_s = speed_m_s, turn_rad_s
        self._at: TimedScan | None = None
        self._stuck = 0

    def sense(self) -> Scan:
        """Return the scan at the present place, as if all its beams had been taken at its end."""
        try:
            if self._at is None:
                self._at = self._robot.scan()
            return de_skewed(self._at, self._robot.odometry)
        except BaseException:
            self._robot.stop()
            raise

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command; return the odometry from the end of the last scan to that of the next."""
        try:
            before = self._at or self._robot.scan()
            self._at = self._driven(command, before)
            odometry = self._robot.odometry(before.end_s, self._at.end_s)
            self._watch(command, odometry)
            return odometry
        except BaseException:
            self._robot.stop()
            raise

    def _driven(self, command: MotionCommand, before: TimedScan) -> TimedScan:
        seconds = max(abs(command.forward_m) / self._speed_m_s, abs(command.turn_rad) / self._turn_rad_s)
        turn_s = max(before.end_s - before.start_s, 1e-3)
        turns = max(int(np.ceil(seconds / turn_s)), 1)
        if seconds > 0.0:
            self._robot.send(Twist(command.forward_m / (turns * turn_s), command.turn_rad / (turns * turn_s)))
        for _ in range(turns):
            self._robot.scan()
        self._robot.stop()
        return self._robot.scan()

    def _watch(self, command: MotionCommand, odometry: Odometry) -> None:
        """Raise RobotError for a robot that stands still again and again though it was told to go."""
        x, y, turn = np.abs(odometry.motion)
        told = abs(command.forward_m) + abs(command.turn_rad)
        self._stuck = self._stuck + 1 if np.hypot(x, y) + turn < SHARE_MOVED * told else 0
        if self._stuck >= TRIES:
            raise RobotError(
                f"expected a robot that moves, found one that stood still at {TRIES} commands in turn, the last of"
                f" {command.forward_m:.2f} m and {np.rad2deg(command.turn_rad):.0f} degrees:"
                " free it, and check its motors and its odometry"
            )


def de_skewed(scan: TimedScan, odometry: Callable[[float, float], Odometry]) -> Scan:
    """Return the scan as it would be had all beams been taken at its end, from where the robot was then.

    Each return is carried along with the motion from its own time to the end; a range between two of one face lies on
    the chord between them. Raises RobotError for what no scan is.
    """
    scan = replace(scan, ranges_m=without_near(scan.ranges_m, scan.range_min_m))
    taken = (scan.sigma_m, scan.range_max_m, scan.end_s, scan.sigma_share, scan.start_s)
    as_taken = Scan.ordered(scan.bearings_rad, scan.ranges_m, *taken)
    places = _places(scan, odometry)
    if np.abs(places).max() < AT_REST:
        return as_taken
    heading = scan.bearings_rad + places[:, 2]
    reach = np.where(np.isposinf(scan.ranges_m), scan.range_max_m, scan.ranges_m)
    points = places[:, :2] + reach[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    known = ~np.isnan(scan.ranges_m)
    ranges = np.full(len(as_taken.bearings_rad), np.nan)
    if known.any():
        ranges = _seen_from_the_end(points[known], np.isposinf(scan.ranges_m[known]), as_taken)
    return Scan(as_taken.bearings_rad, ranges, *taken)


def _places(scan: TimedScan, odometry: Callable[[float, float], Odometry]) -> Float[np.ndarray, "k 3"]:
    """Return where the robot was when each beam was taken, in its frame at the end of the scan."""
    times = np.linspace(scan.start_s, scan.end_s, KNOTS)
    knots = np.array([inverse(odometry(float(t), scan.end_s).motion) for t in times[:-1]] + [np.zeros(3)])
    knots[:, 2] = np.unwrap(knots[:, 2])
    knots[:, 2] -= knots[-1, 2]
    beams = np.linspace(scan.start_s, scan.end_s, len(scan.bearings_rad))
    return np.column_stack([np.interp(beams, times, column) for column in knots.T])


def _seen_from_the_end(points: Float[np.ndarray, "n 2"], is_free: np.ndarray, beams: Scan) -> Float[np.ndarray, " k"]:
    """Return the range along each beam from the origin to points around it; NaN where none is near its direction."""
    bearing, reach = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    order = np.argsort(bearing)
    bearing, reach, points, is_free = bearing[order], reach[order], points[order], is_free[order]
    wanted = wrap(beams.bearings_rad)
    after = np.searchsorted(bearing, wanted) % len(bearing)
    before = after - 1
    off_before, off_after = np.abs(wrap(wanted - bearing[before])), np.abs(wrap(bearing[after] - wanted))
    nearest = np.where(off_before <= off_after, before, after)
    near = np.minimum(off_before, off_after) <= NEAREST_STEPS * beams.step_rad
    ranges = np.where(is_free[nearest], np.inf, reach[nearest])
    apart = np.abs(reach[after] - reach[before])
    one_face = apart < ONE_FACE * np.minimum(reach[before], reach[after])
    one_face &= ~is_free[before] & ~is_free[after] & (off_before + off_after <= 2 * NEAREST_STEPS * beams.step_rad)
    along = points[after] - points[before]
    u = np.stack([np.cos(wanted), np.sin(wanted)], axis=-1)
    cross = u[:, 0] * along[:, 1] - u[:, 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        chord = (points[before, 0] * along[:, 1] - points[before, 1] * along[:, 0]) / cross
    ranges = np.where(one_face & np.isfinite(chord) & (chord > 0.0), chord, ranges)
    beyond = np.isfinite(ranges) & (ranges >= beams.range_max_m)
    return np.where(near, np.where(beyond, np.inf, ranges), np.nan)
