"""The scans of a streaming robot one after another: each newer than the last, none waited for without end."""

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from queue import Empty
from typing import TypeVar

import numpy as np

from .deadline import Watched
from .errors import RobotError
from .messages import Odometry
from .timed import StreamingRobot, TimedScan

REPEAT_S = 0.05
"""While it waits, what drives is told again so often: bases stop by themselves 0.2 to 0.5 s after the last word."""
START_S = 10.0
"""A scanner may take so long to its first scan."""
PAUSE = 0.3
"""A driver that had nothing newer is asked again after this share of the scanner's period."""
GAPS = 5
"""The period of the scanner is the longest of so many times between two scans."""
FIRST_PERIOD_S = 0.1
"""Until two scans have come."""

Answer = TypeVar("Answer")


class ScanStream:
    """Scans and odometry of a robot, with a deadline for each."""

    def __init__(self, robot: StreamingRobot, wait_s: float, clock: Callable[[], float]) -> None:
        self._robot, self._wait_s, self._clock = robot, wait_s, clock
        self._watched = Watched()
        self._last_s, self._came_s = -np.inf, 0.0
        self._gaps: deque[float] = deque(maxlen=GAPS)
        self._slow: deque[float] = deque(maxlen=GAPS)

    @property
    def period_s(self) -> float:
        """From one scan to the next, as they have come of late."""
        return max(self._gaps, default=FIRST_PERIOD_S)

    @property
    def slowness(self) -> float:
        """How many seconds go by for one of the robot's; above 1 for a simulation that is slower than real time."""
        return max(float(np.median(self._slow)), 1.0) if self._slow else 1.0

    @property
    def knows_period(self) -> bool:
        """Whether two scans have come, one after another."""
        return bool(self._gaps)

    def after_pause(self) -> TimedScan:
        """Return the next scan after a time in which nobody listened; it tells nothing of the period."""
        return self._newer(_nothing)

    def next(self, meanwhile: Callable[[int], None]) -> TimedScan:
        """Wait for the scan after the last one and return it; raises RobotError where none comes.

        `meanwhile` is called again and again until then, with how often the driver had nothing newer.
        """
        before_s, came_s = self._last_s, self._came_s
        scan = self._newer(meanwhile)
        if np.isfinite(before_s):
            self._gaps.append(self._last_s - before_s)
            self._slow.append((self._came_s - came_s) / self._gaps[-1])
        return scan

    def odometry(self, from_s: float, to_s: float, meanwhile: Callable[[int], None] | None = None) -> Odometry:
        """Return the robot's motion between two times; raises RobotError where it is not told in time."""
        try:
            return self._call(lambda: self._robot.odometry(from_s, to_s), self._wait_s, meanwhile or _nothing, 0)
        except TimeoutError as error:
            raise RobotError(
                f"expected odometry up to {to_s:.3f} s, found none within {self._wait_s:g} s:"
                " check what the wheels report, and that scans and wheels have one clock"
            ) from error

    def _newer(self, meanwhile: Callable[[int], None]) -> TimedScan:
        wait_s = self._wait_s if np.isfinite(self._last_s) else max(START_S, self._wait_s)
        until, stale, told = time.monotonic() + wait_s, 0, "none"
        while (left_s := until - time.monotonic()) > 0.0:
            with suppress(TimeoutError, Empty):
                scan = self._call(self._robot.scan, left_s, meanwhile, stale)
                if scan is not None and self._is_newer(scan):
                    self._last_s, self._came_s = float(scan.end_s), self._clock()
                    return scan
                told = "none" if scan is None else f"the one of {scan.end_s:.3f} s again"
            stale += 1
            meanwhile(stale)
            time.sleep(min(PAUSE * self.period_s, max(until - time.monotonic(), 0.0)))
        raise RobotError(f"expected a new scan, found {told} within {wait_s:g} s: check the scanner and its driver")

    def _call(self, ask: Callable[[], Answer], wait_s: float, meanwhile: Callable[[int], None], stale: int) -> Answer:
        return self._watched.call(ask, wait_s, REPEAT_S, lambda: meanwhile(stale))

    def _is_newer(self, scan: TimedScan) -> bool:
        """Return whether a scan follows the last one; raises RobotError for times that are none or run backwards."""
        if not np.isfinite(scan.end_s):
            raise RobotError(f"expected a scan with the time of its end, found {scan.end_s}: correct the driver")
        if scan.end_s < self._last_s:
            raise RobotError(
                f"expected scans whose times go on from {self._last_s:.3f} s, found {scan.end_s:.3f} s:"
                " correct the robot's clock"
            )
        return bool(scan.end_s > self._last_s)


def _nothing(_: int) -> None:
    """Wait and do nothing."""
