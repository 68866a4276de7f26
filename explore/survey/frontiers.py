"""Floor that can be driven to and borders on what was never seen: where to find a first wall, or a hidden island."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..floor.free_space import FreeSpace
from ..planning.driving_field import DrivingField

LEAST_CELLS = 4
"""Narrower borders are not worth a visit: they are gaps between beams."""


def frontiers(free_space: FreeSpace, field: DrivingField) -> list[Float[np.ndarray, "n 2"]]:
    """Return the borders between reachable floor and unseen floor, each as the reachable cells' centres, m.

    Borders of fewer than `LEAST_CELLS` cells are left out.
    """
    unknown = free_space.evidence == 0
    beside = np.zeros_like(unknown)
    beside[1:] |= unknown[:-1]
    beside[:-1] |= unknown[1:]
    beside[:, 1:] |= unknown[:, :-1]
    beside[:, :-1] |= unknown[:, 1:]
    cells = np.argwhere(beside & (free_space.evidence < 0))
    cells = cells[field.can_stay(cells)]
    return [free_space.points(border) for border in connected(cells, 1.5) if len(border) >= LEAST_CELLS]


def connected(cells: Int[np.ndarray, "n 2"], reach_cells: float) -> list[Int[np.ndarray, "m 2"]]:
    """Return few cells of a large grid in groups, each joined by steps of at most `reach_cells`."""
    if not len(cells):
        return []
    pairs = cKDTree(cells.reshape(-1, 2)).query_pairs(reach_cells, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    group = connected_components(links, directed=False)[1]
    return np.split(cells[np.argsort(group, kind="stable")], np.cumsum(np.bincount(group))[:-1])


def borders_on_unseen(free_space: FreeSpace, points_world: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
    """Return which points lie in cells of which a neighbour was never seen."""
    cell = free_space.config.cell_m
    offsets = cell * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    around = (points_world[:, None] + offsets).reshape(-1, 2)
    return np.asarray(free_space.unknown_at(around).reshape(-1, 4).any(axis=1))
