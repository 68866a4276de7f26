"""What the last few scans hit nearby: of a corner, each scan alone shows one noisy return or none."""

from collections import deque

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import to_robot, to_world, wrap
from chainslam.slam.robot import Odometry, RobotSpec, Scan, ScannerSpec

SCANS = 4
"""So many scans before the present one are remembered; over so few steps the odometry errs by millimetres."""
NEAR_BEYOND_M = 0.4
"""Returns farther off the body than this matter to no step from here."""
SAME_STEPS, SAME_SIGMAS = 0.6, 4.0
"""Returns of two scans so near in bearing and distance are of one place: half a beam's step, and four sigmas."""


class AccumulatedReturns:
    """Returns near the robot, kept in its frame by what the odometry reports."""

    def __init__(self, robot: RobotSpec = RobotSpec()) -> None:
        self._near_m, self._scanner = robot.beyond(NEAR_BEYOND_M), robot.scanner
        self._scans: deque[Float[np.ndarray, "n 2"]] = deque(maxlen=SCANS)

    def move(self, odometry: Odometry) -> None:
        """Take note that the robot has moved."""
        for k, points in enumerate(self._scans):
            self._scans[k] = to_robot(points, odometry.motion)

    def see(self, scan: Scan) -> None:
        """Remember what a scan hit nearby."""
        points = returns(scan, self._scanner)
        self._scans.append(points[np.hypot(points[:, 0], points[:, 1]) < self._near_m])

    @property
    def points_robot(self) -> Float[np.ndarray, "n 2"]:
        """All that is remembered, m, robot frame."""
        return np.concatenate([np.zeros((0, 2)), *self._scans])


def steadied(
    scan: Scan, recent_robot: Float[np.ndarray, "r 2"], robot: RobotSpec = RobotSpec()
) -> Float[np.ndarray, "m 2"]:
    """Return the points that a scan hit, those nearby at the mean of the distances that the last scans had there, m.

    What the last scans hit and this one does not follows as it was: a corner between two of its beams, or behind it.
    Between two walls the nearest of a dozen noisy returns on each side are 2.5 cm nearer than the walls.
    """
    points_robot = returns(scan, robot.scanner)
    (rho, bearing), (before, at) = (
        (np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])) for points in (points_robot, recent_robot)
    )
    near = rho < robot.beyond(NEAR_BEYOND_M)
    turn = np.abs(wrap(bearing[near, None] - at))
    same_m = SAME_SIGMAS * scan.sigmas_m[np.isfinite(scan.ranges_m)][near, None]
    same = (turn < SAME_STEPS * scan.step_rad) & (np.abs(rho[near, None] - before) < same_m)
    mean = rho.copy()
    mean[near] = (rho[near] + same @ before) / (1.0 + np.count_nonzero(same, axis=1))
    return np.concatenate([points_robot * (mean / np.maximum(rho, 1e-9))[:, None], recent_robot[~same.any(axis=0)]])


def returns(scan: Scan, scanner: ScannerSpec) -> Float[np.ndarray, "m 2"]:
    """Return the points that the scan of a scanner on the body hit, robot frame, m."""
    hit = np.isfinite(scan.ranges_m)
    bearing, distance = scan.bearings_rad[hit], scan.ranges_m[hit]
    points = np.stack([distance * np.cos(bearing), distance * np.sin(bearing)], axis=-1)
    return points if scanner.is_at_axle else to_world(points, scanner.pose_robot)
