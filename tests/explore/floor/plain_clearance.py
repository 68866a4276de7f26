"""Clearances by one distance transform of the whole grid."""

import numpy as np
from scipy.ndimage import distance_transform_edt


def full_clearance(grid):
    """The distance of every cell to the nearest that was hit or touched, m, up to the limit of the grid."""
    limit = grid.config.clearance_limit_m
    occupied = grid.occupied
    if not occupied.any():
        return np.full(grid.shape, limit)
    return np.minimum(distance_transform_edt(~occupied, sampling=grid.config.cell_m), limit)
