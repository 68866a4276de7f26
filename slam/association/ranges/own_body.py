"""Returns of the robot's own body, which is no obstacle to itself."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from ...robot import RobotSpec, Scan
from ...robot.body import depths_m


class OwnBody:
    """Takes out of each scan what lies inside the outline that a robot states.

    A return deeper inside than noise brings a wall beside the body shows something of the body: from then on any return
    inside is the body's in that direction.
    """

    def __init__(self, robot: RobotSpec, noise_sigmas: float) -> None:
        self._robot, self._noise_sigmas = robot, noise_sigmas
        self._own: Bool[np.ndarray, " k"] = np.zeros(0, dtype=bool)
        """Beams at whose bearing something of the body stands."""

    def without(self, scan: Scan) -> tuple[Scan, int]:
        """Return a scan in which the body's returns tell nothing, and how many there are."""
        ranges_m = scan.ranges_m
        near = np.flatnonzero(ranges_m < self._robot.radius_m + self._robot.scanner.off_m)
        if not len(near):
            return scan, 0
        if len(self._own) != len(ranges_m):
            self._own = np.zeros(len(ranges_m), dtype=bool)
        depths = np.full(len(ranges_m), -np.inf)
        depths[near] = depths_m(_points(scan, near, self._robot), self._robot)
        sure = depths > self._noise_sigmas * scan.sigmas_m
        self._own |= sure | np.roll(sure, 1) | np.roll(sure, -1)
        own = (depths > 0.0) & self._own
        count = int(np.count_nonzero(own))
        return (replace(scan, ranges_m=np.where(own, np.nan, ranges_m)), count) if count else (scan, 0)


def _points(scan: Scan, beams: np.ndarray, robot: RobotSpec) -> Float[np.ndarray, "m 2"]:
    """Return where some beams ended, robot frame, m."""
    angle, scanner = scan.bearings_rad[beams] + robot.scanner.heading_rad, robot.scanner.pose_robot[:2]
    return scanner + scan.ranges_m[beams, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
