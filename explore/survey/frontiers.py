"""Floor that can be driven to and borders on what was never seen: where to find a first wall, or a hidden island."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..floor.free_space import FreeSpace
from ..planning.driving_field import DrivingField
from ..planning.sight import cells_within

LEAST_CELLS = 4
"""Narrower borders are not worth a visit: they are gaps between beams."""
PIECE_M = 1.5
"""Side of the squares that cut a border into pieces."""


def frontiers(free_space: FreeSpace, field: DrivingField, *, only_near: bool = False) -> list[Float[np.ndarray, "n 2"]]:
    """Return the borders between reachable floor and unseen floor, each as the reachable cells' centres, m.

    Borders of fewer than `LEAST_CELLS` cells are left out. With `only_near`, what of them lies near to the start of the
    field: much cheaper.
    """
    box = field.near_box if only_near else (slice(0, None), slice(0, None))
    unknown = free_space.evidence[box] == 0
    beside = np.zeros_like(unknown)
    beside[1:] |= unknown[:-1]
    beside[:-1] |= unknown[1:]
    beside[:, 1:] |= unknown[:, :-1]
    beside[:, :-1] |= unknown[:, 1:]
    cells = np.argwhere(beside & free_space.is_free(box)) + np.array([box[0].start, box[1].start])
    cells = cells[field.can_stay(cells, only_near=only_near)]
    return [free_space.points(border) for border in connected(cells, 1.5) if len(border) >= LEAST_CELLS]


def pieces(points_world: Float[np.ndarray, "n 2"]) -> list[Float[np.ndarray, "m 2"]]:
    """Return the points of a border in groups, each within a square of a fixed grid: a long one is many places."""
    _, group = np.unique(np.floor(points_world / PIECE_M), axis=0, return_inverse=True)
    return in_groups(points_world, group.ravel())


def connected(cells: Int[np.ndarray, "n 2"], reach_cells: float) -> list[Int[np.ndarray, "m 2"]]:
    """Return few cells of a large grid in groups, each joined by steps of at most `reach_cells`."""
    if not len(cells):
        return []
    pairs = cKDTree(cells.reshape(-1, 2)).query_pairs(reach_cells, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    return in_groups(cells, connected_components(links, directed=False)[1])


def in_groups(rows: np.ndarray, group: Int[np.ndarray, " n"]) -> list[np.ndarray]:
    """Return the rows of each group, numbered from 0, in their order."""
    return np.split(rows[np.argsort(group, kind="stable")], np.cumsum(np.bincount(group))[:-1])


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
