"""Floor that can be driven to and borders on what was never seen: where to find a first wall, or a hidden island."""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import label

from .free_space import FreeSpace
from .paths import PathConfig, Planner


def unseen_borders(
    free_space: FreeSpace, position_world: Float[np.ndarray, "2"], config: PathConfig, least_cells: int = 4
) -> list[Float[np.ndarray, "n 2"]]:
    """Return the borders between reachable floor and unseen floor, each as the reachable cells' centres, m.

    Borders of fewer than `least_cells` cells are left out.
    """
    reachable = np.zeros(free_space.shape, dtype=bool)
    reachable[tuple(Planner(free_space, position_world, config).reachable_cells().T)] = True
    unknown = free_space.evidence == 0
    beside = np.zeros_like(unknown)
    beside[1:] |= unknown[:-1]
    beside[:-1] |= unknown[1:]
    beside[:, 1:] |= unknown[:, :-1]
    beside[:, :-1] |= unknown[:, 1:]
    labels, count = label(reachable & beside, structure=np.ones((3, 3)))
    borders = [free_space.points(np.argwhere(labels == k)) for k in range(1, count + 1)]
    return [border for border in borders if len(border) >= least_cells]
