"""Floor that can be driven to and borders on what was never seen: where to find a first wall, or a hidden island."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import find_objects, label

from .free_space import FreeSpace
from .paths import cells_within


def unseen_borders(
    free_space: FreeSpace, reachable: Bool[np.ndarray, "h w"], least_cells: int = 4
) -> list[Float[np.ndarray, "n 2"]]:
    """Return the borders between reachable floor and unseen floor, each as the reachable cells' centres, m.

    Borders of fewer than `least_cells` cells are left out.
    """
    unknown = free_space.evidence == 0
    beside = np.zeros_like(unknown)
    beside[1:] |= unknown[:-1]
    beside[:-1] |= unknown[1:]
    beside[:, 1:] |= unknown[:, :-1]
    beside[:, :-1] |= unknown[:, 1:]
    labels, _ = label(reachable & beside, structure=np.ones((3, 3)))
    borders = []
    for k, box in enumerate(find_objects(labels), start=1):
        corner = np.array([box[0].start, box[1].start])
        borders.append(free_space.points(np.argwhere(labels[box] == k) + corner))
    return [border for border in borders if len(border) >= least_cells]


def borders_on_unseen(free_space: FreeSpace, points_world: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
    """Return which points lie in cells of which a neighbour was never seen."""
    cell = free_space.config.cell_m
    offsets = cell * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    around = (points_world[:, None] + offsets).reshape(-1, 2)
    return np.asarray(free_space.unknown_at(around).reshape(-1, 4).any(axis=1))


def known_floor(free_space: FreeSpace, place_world: Float[np.ndarray, "2"], reach_m: float) -> int:
    """Return how many cells within reach of a place were seen, free or not."""
    cells = cells_within(free_space, place_world, reach_m)
    return int(np.count_nonzero(free_space.evidence[tuple(cells.T)]))
