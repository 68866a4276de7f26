"""What moves: returns amid floor that many beams had passed before, away from every wall of the map."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import maximum_filter

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import Scan, ScannerSpec

from ..floor.accumulated_returns import returns
from ..floor.free_space import FreeSpace
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
    moving = points[_is_amid_free_floor(free_space, points)]
    if len(moving) >= LEAST_RETURNS:
        moving = moving[~TrustedWalls(walls).near(moving, APART_M)]
    return moving if len(moving) >= LEAST_RETURNS else moving[:0]


def _is_amid_free_floor(free_space: FreeSpace, points_world: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
    """Return which points lie in free cells with no occupied cell beside them."""
    cells = free_space.cells(points_world)
    found = np.zeros(len(cells), dtype=bool)
    inside = free_space.inside(cells)
    if not inside.any():
        return found
    low, high = cells[inside].min(axis=0), cells[inside].max(axis=0) + 1
    first = np.maximum(low - 1, 0)
    around = free_space.evidence[first[0] : high[0] + 1, first[1] : high[1] + 1]
    here = tuple((cells[inside] - first).T)
    found[inside] = (around[here] < 0) & (maximum_filter(around, 3, mode="nearest")[here] <= 0)
    return found
