"""The floor seen in a recorded drive, computed at its end, when all poses are known."""

import numpy as np
from jaxtyping import Float

from chainslam.explore.floor.free_space import FloorTooLargeError, FreeSpace, FreeSpaceConfig
from chainslam.sim.logs.recorded_robot import Recording
from chainslam.slam.odometry.config import ScanMatchingConfig


def drawn_floor(recording: Recording, poses_world: Float[np.ndarray, "s 3"], config: FreeSpaceConfig) -> FreeSpace:
    """Return the floor that a recording's scans show from these poses; empty if no grid is large enough."""
    floor = FreeSpace(config)
    try:
        for index, pose_world in enumerate(poses_world):
            floor.integrate(pose_world, recording.scan(index).within(ScanMatchingConfig.reach_m))
    except FloorTooLargeError:
        return FreeSpace(config)
    return floor
