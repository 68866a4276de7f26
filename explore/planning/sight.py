"""What can be seen from where on the grid, and the cells around a place."""

import numpy as np
from jaxtyping import Bool, Float, Int

from ..floor.free_space import FreeSpace
from .grid_kernels import lines_free


def sees(
    free_space: FreeSpace, places_world: Float[np.ndarray, "n 2"], target_world: Float[np.ndarray, "2"], short_m: float
) -> Bool[np.ndarray, " n"]:
    """Return from which places no occupied cell stands between there and `short_m` before the target."""
    first = -free_space.cells(np.zeros(2))
    return lines_free(free_space.evidence, first, free_space.config.cell_m, places_world, target_world, short_m)


def cells_within(free_space: FreeSpace, centre_world: Float[np.ndarray, "2"], reach_m: float) -> Int[np.ndarray, "n 2"]:
    """Return the cells of the grid whose centres lie within reach of a place."""
    reach = int(np.ceil(reach_m / free_space.config.cell_m))
    centre = free_space.cells(centre_world)
    low, high = np.maximum(centre - reach, 0), np.minimum(centre + reach + 1, free_space.shape)
    cells = np.moveaxis(np.mgrid[low[0] : high[0], low[1] : high[1]], 0, -1).reshape(-1, 2)
    return cells[np.hypot(*(free_space.points(cells) - centre_world).T) <= reach_m]
