"""The floor that the scans of a recorded drive show, drawn once the drive is over and its poses are known."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from explore.floor.free_space import FloorTooLargeError, FreeSpace, FreeSpaceConfig
from sim.logs.recorded_robot import Recording
from slam.odometry.config import ScanMatchingConfig
from slam.robot import Scan


def drawn_floor(
    recording: Recording, poses_world: Float[np.ndarray, "s 3"], config: FreeSpaceConfig
) -> FreeSpace | None:
    """Return the free floor by a recording's scans at these poses; None where no grid is large enough for them."""
    floor = FreeSpace(config)
    try:
        for index, pose_world in enumerate(poses_world):
            floor.integrate(pose_world, _near_returns(recording.scan(index)))
    except FloorTooLargeError:
        return None
    return floor


def _near_returns(scan: Scan) -> Scan:
    """Return a scan of near returns alone: a real scanner gets none from glass and black walls, either."""
    reach_m = min(ScanMatchingConfig.reach_m, scan.range_max_m)
    ranges_m = np.where(scan.ranges_m > reach_m, np.inf, scan.ranges_m)
    return replace(scan, ranges_m=np.where(np.isposinf(scan.ranges_m), np.nan, ranges_m), range_max_m=reach_m)
