"""What moves: returns amid floor that many beams had passed before, away from every wall of the map."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import Scan, ScannerSpec

from ..floor.accumulated_returns import returns
from ..floor.free_space import FreeSpace
from ..floor.return_kernels import amid_free_floor
from .trusted_walls import TrustedWalls
from .unmapped_obstacles import APART_M

LEAST_RETURNS = 3
"""Fewer are single beams that ended on noise or on an edge."""


def moving_returns(
    scan: Scan, free_space: FreeSpace, walls: StochasticMap, scanner: ScannerSpec
) -> Float[np.ndarray, "m 2"]:
    """Return the returns of a scan that something moving made, world frame, m; none where they are too few.

    The scan is in the free space already: a cell that is free in spite of a hit was passed by many beams before. What
    stands is no longer told once it was hit twice.
    """
    points = to_world(returns(scan, scanner), walls.belief.pose_world)
    moving = points[amid_free_floor(free_space.evidence, free_space.cells(points))]
    if len(moving) >= LEAST_RETURNS:
        moving = moving[~TrustedWalls(walls).near(moving, APART_M)]
    return moving if len(moving) >= LEAST_RETURNS else moving[:0]
