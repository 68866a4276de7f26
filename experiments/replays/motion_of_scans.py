"""Odometry for a log without one: each scan is matched with earlier ones, starting from the last motion."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from chainslam.sim.logs.raw_scan import LogError, RawScan
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.odometry.config import ScanMatchingConfig
from chainslam.slam.odometry.scan_matching import ScanMatcher
from chainslam.slam.robot import Odometry, Scan

KEPT_M, KEPT_RAD = 0.1, float(np.deg2rad(5.0))
"""Distance after which a scan becomes one of the reference scans."""
CHANGE_M_S, CHANGE_RAD_S = 0.5, 1.0
"""Standard deviation of the change of speed between two scans, per second between them."""
LEAST_M, LEAST_RAD = 0.02, float(np.deg2rad(2.0))
"""Lower limit of the standard deviation of a predicted motion."""
MOST_M, MOST_RAD = 0.3, float(np.deg2rad(15.0))
"""Upper limit of the standard deviation of the search."""
SIGMA_M = 0.02


def motion_of_scans(scans: Iterator[RawScan | LogError]) -> Iterator[RawScan | LogError]:
    """Yield scans with odometry: that of the log, or that of scan matching if it has none."""
    told = _Told()
    for scan in scans:
        yield scan if isinstance(scan, LogError) or scan.robot_odom is not None else told.at(scan)


class _Told:
    """Pose after the last scan by scan matching."""

    def __init__(self) -> None:
        self._matcher = ScanMatcher(ScanMatchingConfig())
        self._kept = np.zeros(3)
        self._pose = np.zeros(3)
        self._speed = np.zeros(3)
        """Velocity of the robot in its own frame, m/s m/s rad/s."""
        self._time_s: float | None = None

    def at(self, raw: RawScan) -> RawScan:
        """Return a scan with its pose."""
        scan = Scan(raw.bearings_rad, raw.ranges_m, SIGMA_M, raw.range_max_m, raw.time_s)
        if self._time_s is None:
            self._matcher.begin(scan)
        else:
            self._follow(scan, max(raw.time_s - self._time_s, 0.0))
        self._time_s = raw.time_s
        return replace(raw, robot_odom=self._pose, scanner_odom=None)

    def _follow(self, scan: Scan, seconds: float) -> None:
        guess = compose(inverse(self._kept), compose(self._pose, self._speed * seconds))
        sigma_m = min(LEAST_M + CHANGE_M_S * seconds, MOST_M)
        sigma_rad = min(LEAST_RAD + CHANGE_RAD_S * seconds, MOST_RAD)
        foretold = Odometry(guess, np.diag([sigma_m, sigma_m, sigma_rad]) ** 2)
        motion = self._matcher.match(scan, foretold, keep=False).motion
        if np.hypot(*motion[:2]) >= KEPT_M or abs(motion[2]) >= KEPT_RAD:
            motion = self._matcher.match(scan, foretold).motion
            pose = self._kept = compose(self._kept, motion)
        else:
            pose = compose(self._kept, motion)
        if seconds > 0.0:
            self._speed = compose(inverse(self._pose), pose) / seconds
        self._pose = pose
