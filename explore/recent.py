"""What the last few scans hit nearby: of a corner, each scan alone shows one noisy return or none."""

from collections import deque

import numpy as np
from jaxtyping import Float

from slam.geometry.poses import to_robot
from slam.robot import Odometry, Scan

SCANS = 4
"""So many scans before the present one are remembered; over so few steps the wheels slip by millimetres."""
NEAR_M = 0.6
"""Returns farther off than this matter to no step from here."""


class RecentReturns:
    """Returns near the robot, kept in its frame by what the wheels report."""

    def __init__(self) -> None:
        self._scans: deque[Float[np.ndarray, "n 2"]] = deque(maxlen=SCANS)

    def move(self, odometry: Odometry) -> None:
        """Take note that the robot has moved."""
        for k, points in enumerate(self._scans):
            self._scans[k] = to_robot(points, odometry.motion)

    def see(self, scan: Scan) -> None:
        """Remember what a scan hit nearby."""
        points = returns(scan)
        self._scans.append(points[np.hypot(points[:, 0], points[:, 1]) < NEAR_M])

    @property
    def points_robot(self) -> Float[np.ndarray, "n 2"]:
        """All that is remembered, m, robot frame."""
        return np.concatenate([np.zeros((0, 2)), *self._scans])


def returns(scan: Scan) -> Float[np.ndarray, "m 2"]:
    """Return the points that the scan hit, robot frame, m."""
    hit = np.isfinite(scan.ranges_m)
    bearing, distance = scan.bearings_rad[hit], scan.ranges_m[hit]
    return np.stack([distance * np.cos(bearing), distance * np.sin(bearing)], axis=-1)
