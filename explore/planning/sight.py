"""What can be seen from where on the grid, and the cells around a place."""

import numpy as np
from jaxtyping import Bool, Float, Int

from ..floor.free_space import FreeSpace


def sees(
    free_space: FreeSpace, places_world: Float[np.ndarray, "n 2"], target_world: Float[np.ndarray, "2"], short_m: float
) -> Bool[np.ndarray, " n"]:
    """Return from which places no occupied cell stands between there and `short_m` before the target."""
    way = target_world - places_world
    length = np.hypot(way[:, 0], way[:, 1])
    steps = int(np.ceil(length.max(initial=0.0) / free_space.config.cell_m)) + 1
    share = np.linspace(0.0, 1.0, steps + 1) * np.clip(1.0 - short_m / np.maximum(length, 1e-9), 0.0, 1.0)[:, None]
    cells = free_space.cells(places_world[:, None] + share[..., None] * way[:, None])
    inside = free_space.inside(cells)
    blocked = np.zeros(inside.shape, dtype=bool)
    blocked[inside] = free_space.evidence[tuple(cells[inside].T)] > 0
    return ~np.any(blocked | ~inside, axis=1)


def cells_within(free_space: FreeSpace, centre_world: Float[np.ndarray, "2"], reach_m: float) -> Int[np.ndarray, "n 2"]:
    """Return the cells of the grid whose centres lie within reach of a place."""
    reach = int(np.ceil(reach_m / free_space.config.cell_m))
    offsets = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = free_space.cells(centre_world[None])[0] + offsets
    cells = cells[free_space.inside(cells)]
    return cells[np.hypot(*(free_space.points(cells) - centre_world).T) <= reach_m]
