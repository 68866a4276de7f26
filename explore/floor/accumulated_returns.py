"""What the last few scans hit nearby: of a corner, each scan alone shows one noisy return or none."""

from collections import deque

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import to_robot, to_world
from chainslam.slam.robot import Odometry, RobotSpec, Scan, ScannerSpec

from .return_kernels import hits_of, same_places

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
        self._counts = deque([0] * SCANS, maxlen=SCANS)
        self.points_robot: Float[np.ndarray, "n 2"] = np.zeros((0, 2))
        """All that is remembered, m, robot frame."""

    def move(self, odometry: Odometry) -> None:
        """Take note that the robot has moved."""
        self.points_robot = to_robot(self.points_robot, odometry.motion)

    def see(self, scan: Scan) -> None:
        """Remember what a scan hit nearby."""
        points = returns(scan, self._scanner)
        near = points[np.hypot(points[:, 0], points[:, 1]) < self._near_m]
        self.points_robot = np.concatenate([self.points_robot[self._counts[0] :], near])
        self._counts.append(len(near))


def steadied(
    scan: Scan, recent_robot: Float[np.ndarray, "r 2"], robot: RobotSpec = RobotSpec()
) -> Float[np.ndarray, "m 2"]:
    """Return the points that a scan hit, those nearby at the mean of the distances that the last scans had there, m.

    What the last scans hit and this one does not follows as it was: a corner between two of its beams, or behind it.
    Between two walls the nearest of a dozen noisy returns on each side are 2.5 cm nearer than the walls.
    """
    points_robot = returns(scan, robot.scanner)
    same_m = SAME_SIGMAS * scan.sigmas_m[np.isfinite(scan.ranges_m)]
    near_m, same_rad = robot.beyond(NEAR_BEYOND_M), SAME_STEPS * scan.step_rad
    near, rho, before, same = same_places(points_robot, same_m, recent_robot, near_m, same_rad)
    mean = (rho + same @ before) / (1.0 + same.sum(axis=1))
    points_robot[near] *= (mean / np.maximum(rho, 1e-9))[:, None]
    return np.concatenate([points_robot, recent_robot[~same.any(axis=0)]])


def returns(scan: Scan, scanner: ScannerSpec) -> Float[np.ndarray, "m 2"]:
    """Return the points that the scan of a scanner on the body hit, robot frame, m."""
    points = hits_of(scan.bearings_rad, scan.ranges_m)
    return points if scanner.is_at_axle else to_world(points, scanner.pose_robot)
