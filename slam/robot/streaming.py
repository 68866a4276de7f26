"""A robot that streams, made into one that steps: scans come by the clock, motion goes on until it is stopped."""

import time
from collections.abc import Callable

import numpy as np

from .deskew import de_skewed
from .errand import Errand, Gains
from .errors import RobotError
from .messages import MotionCommand, Odometry, Scan
from .scan_stream import ScanStream
from .timed import StreamingRobot, TimedScan, Twist

__all__ = ["SteppedRobot", "StreamingRobot", "TimedScan", "Twist", "de_skewed"]

SHARE_MOVED, TRIES = 0.1, 3
"""A robot that goes less than this share of its commands, so many times in turn, does not move."""
STROKES, ENOUGH = 3, 0.08
"""A command is gone on with after a stop, so many times at most, where more than this share of it is left."""
OVERDUE = 4.0
"""Where no scan has come for so many periods, what drives halts."""
OBEYED = 0.2
"""It is not where less than this share of what was sent was seen to be driven: the odometry may have died."""
STILL_S, STILL_M, STILL_RAD = 0.3, 0.003, 0.005
"""A robot that moves by no more in so many seconds stands."""
SEEN, LATE_S = 0.8, 1.0
"""Odometry that shows less than this share of what was sent may be late; it is waited for so long."""
ROUNDING_S = 1e-6
"""Times that differ by less are one."""
STOPPING_S = 3.0
"""A robot that moves on so long after a stop cannot be stopped."""


class SteppedRobot:
    """Makes a `Robot` of a streaming robot, which stands still between two steps.

    A command ends once the odometry has reached it or all of it was sent, whichever comes first; velocities are sent
    repeatedly. On any error the robot is stopped first. Raises RobotError if scans or odometry fail to arrive for
    `wait_s`, if the robot drives 1.3 times as far as commanded or cannot be stopped, and if it did not move on three
    commands in a row. `clock` returns the robot's time in seconds, for simulators that do not run in real time.
    """

    def __init__(
        self,
        robot: StreamingRobot,
        speed_m_s: float = 0.2,
        turn_rad_s: float = 0.6,
        wait_s: float = 3.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        for name, value in {"speed_m_s": speed_m_s, "turn_rad_s": turn_rad_s, "wait_s": wait_s}.items():
            if not 0.0 < value < np.inf:
                raise RobotError(f"expected a {name} above 0 and finite, found {value:g}: correct it")
        self._robot, self._stream, self._clock = robot, ScanStream(robot, wait_s, clock), clock
        self._speed_m_s, self._turn_rad_s = speed_m_s, turn_rad_s
        self._at: TimedScan | None = None
        self._stuck = 0
        self._gains: Gains = {}

    def sense(self) -> Scan:
        """Return the scan at the present pose, de-skewed to its last beam."""
        try:
            if self._at is None:
                self._at = self._stream.after_pause()
            return de_skewed(self._at, self._stream.odometry)
        except BaseException:
            self._robot.stop()
            raise

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command; return the odometry from the end of the last scan to that of the next."""
        try:
            before = self._at or self._stream.after_pause()
            errand = Errand(command, self._speed_m_s, self._turn_rad_s, self._gains)
            self._at = self._driven(errand)
            odometry = self._stream.odometry(before.end_s, self._at.end_s)
            self._watch(command, odometry)
            return odometry
        except BaseException:
            self._robot.stop()
            raise

    def _driven(self, errand: Errand) -> TimedScan:
        """Drive an errand and return the first scan that was taken at rest after it."""
        start = self._stream.after_pause()
        while not self._stream.knows_period:
            start = self._stream.next(self._stop)
        for _ in range(STROKES if errand.seconds > 0.0 else 0):
            done, sent = errand.done, errand.sent
            self._stroke(errand, start)
            at = self._at_rest(errand, start)
            errand.begin()
            if errand.left < ENOUGH or errand.done - done < OBEYED * (errand.sent - sent):
                return at
        return self._at_rest(errand, start)

    def _stroke(self, errand: Errand, start: TimedScan) -> None:
        """Drive until nothing is left of the errand."""
        errand.begin()
        at = start if errand.sent == 0.0 else self._stream.next(self._stop)
        while (rate := errand.rate(self._stream.period_s)) > 0.0:
            motion = _Motion(self._robot, errand.twist(rate), errand.left / rate, self._stream, self._clock)
            after = self._stream.next(motion.keep)
            came_s = self._clock()
            odometry = self._stream.odometry(start.end_s, after.end_s, motion.keep)
            # While it waited for odometry the robot drove, too: scans may have queued up meanwhile.
            waited_s = (self._clock() - came_s) / self._stream.slowness
            errand.add(rate * motion.driven_s(max(float(after.end_s - at.end_s), waited_s)), odometry)
            at = after

    def _at_rest(self, errand: Errand, start: TimedScan) -> TimedScan:
        """Stop; return a scan during which the robot stood. Raises RobotError where it does not come to rest."""
        self._robot.stop()
        first = self._stream.next(self._stop)
        while True:
            at = self._stream.next(self._stop)
            errand.add(0.0, self._stream.odometry(start.end_s, at.end_s, self._stop))
            since_s, still_s = at.end_s - first.end_s, max(STILL_S, at.end_s - at.start_s)
            if since_s < still_s - ROUNDING_S:
                continue
            moved = self._stream.odometry(at.end_s - still_s, at.end_s, self._stop).motion
            is_seen = errand.done >= SEEN * errand.sent or since_s >= LATE_S
            if is_seen and np.hypot(*moved[:2]) <= STILL_M and abs(moved[2]) <= STILL_RAD:
                return at
            if since_s > STOPPING_S + still_s:
                raise RobotError(
                    f"expected a robot that stands after a stop, found {np.hypot(*moved[:2]):.3f} m and"
                    f" {np.rad2deg(abs(moved[2])):.1f} degrees in the last {still_s:.1f} s, {since_s:.1f} s after it:"
                    " check its motors and its odometry"
                )

    def _stop(self, _: int) -> None:
        self._robot.stop()

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


class _Motion:
    """A twist that is sent again while it lasts; then the robot is stopped, whether scans come or not."""

    def __init__(
        self, robot: StreamingRobot, twist: Twist, seconds: float, stream: ScanStream, clock: Callable[[], float]
    ) -> None:
        self._robot, self._twist, self._clock = robot, twist, clock
        self._seconds, self._most_s = seconds, seconds * stream.slowness
        self._periods = min(seconds / stream.period_s, OVERDUE)
        self._since_s, self._is_over = clock(), False
        robot.send(twist)

    def keep(self, stale: int) -> None:
        """Send the twist again; or a stop, once it has lasted long enough or so many scans have stayed away."""
        over = self._clock() - self._since_s >= self._most_s or stale > max(self._periods - 1.0, 0.0)
        self._is_over = self._is_over or over
        if self._is_over:
            self._robot.stop()
        else:
            self._robot.send(self._twist)

    def driven_s(self, seconds: float) -> float:
        """Return how long it lasted of the time between two scans."""
        return min(seconds, self._seconds) if self._is_over else seconds
