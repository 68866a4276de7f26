"""Loops over the cells of a grid, and over blocks of them: a grid up to sixteen times smaller."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.compiled import compiled

MOST_CELLS = 4
"""Cells on each side of a block, at most: 0.2 m."""


def block_cells(radius_m: float, cell_m: float) -> int:
    """Return how many cells a block has on each side.

    Cells in which the body fits, on both sides of a wall, lie farther than its diameter from one another. Two blocks
    side by side are narrower than that, so they do not reach through one.
    """
    return max(min(MOST_CELLS, int((2.0 * radius_m / cell_m + 1.0) / 2.0 + 1e-9)), 1)


@compiled
def blocks_with_any(cells: Bool[np.ndarray, "h w"], block: int) -> Bool[np.ndarray, "p q"]:
    """Return which blocks hold any of the cells; the blocks count from the first cell, the last may be cut short."""
    h, w = cells.shape
    found = np.zeros((-(-h // block), -(-w // block)), np.bool_)
    for r in range(h):
        row = r // block
        for column in range(found.shape[1]):
            holds = found[row, column]
            for c in range(block * column, min(block * (column + 1), w)):
                holds |= cells[r, c]
            found[row, column] = holds
    return found


def cells_of(blocks: Bool[np.ndarray, "p q"], shape: tuple[int, ...], block: int) -> Bool[np.ndarray, "h w"]:
    """Return the cells of blocks, on a grid of this shape."""
    return blocks.repeat(block, axis=0).repeat(block, axis=1)[: shape[0], : shape[1]]


@compiled
def metres_from(
    metres: Float[np.ndarray, "p q"], places: Float[np.ndarray, "n 2"], side_m: float
) -> Float[np.ndarray, " n"]:
    """Return the least of what the nine blocks at each place (row, column) have and of how far their middles are."""
    (h, w), best = metres.shape, np.full(len(places), np.inf)
    for n in range(len(places)):
        row, column = (min(max(math.floor(places[n, 0]), -1), h - 2), min(max(math.floor(places[n, 1]), -1), w - 2))
        for r in range(max(row, 0), min(row + 3, h)):
            for c in range(max(column, 0), min(column + 3, w)):
                gap_m = math.hypot(places[n, 0] - (r - 0.5), places[n, 1] - (c - 0.5)) * side_m
                best[n] = min(best[n], metres[r, c] + gap_m)
    return best


@compiled
def outwards(metres: Float[np.ndarray, "h w k"], cells: int, cost_m: float) -> Float[np.ndarray, "h w k"]:
    """Return a field that goes on a few cells beyond where a way leads, at so much a cell."""
    h, w, turns = metres.shape
    for _ in range(cells):
        inner, metres = metres, metres.copy()
        for r in range(h):
            for c in range(w):
                for k in range(turns):
                    if inner[r, c, k] == np.inf:
                        least = min(
                            inner[r - 1, c, k] if r > 0 else np.inf,
                            inner[r + 1, c, k] if r + 1 < h else np.inf,
                            inner[r, c - 1, k] if c > 0 else np.inf,
                            inner[r, c + 1, k] if c + 1 < w else np.inf,
                        )
                        metres[r, c, k] = least + cost_m
    return metres


@compiled
def lines_free(
    evidence: Int[np.ndarray, "h w"],
    first: Int[np.ndarray, "2"],
    cell_m: float,
    places_world: Float[np.ndarray, "n 2"],
    target_world: Float[np.ndarray, "2"],
    short_m: float,
) -> Bool[np.ndarray, " n"]:
    """Return from which places no occupied cell, and none off the grid, stands up to so far before a target.

    `first` is the row and column of the grid's first cell in the world.
    """
    h, w = evidence.shape
    way, is_free = target_world - places_world, np.ones(len(places_world), np.bool_)
    length, longest = np.hypot(way[:, 0], way[:, 1]), 0.0
    for each in length:
        longest = max(longest, each)
    steps = math.ceil(longest / cell_m) + 1
    for n in range(len(way)):
        most = min(max(1.0 - short_m / max(length[n], 1e-9), 0.0), 1.0)
        for k in range(steps + 1):
            share = (k * (1.0 / steps) if k < steps else 1.0) * most
            c = math.floor((places_world[n, 0] + share * way[n, 0]) / cell_m) - first[1]
            r = math.floor((places_world[n, 1] + share * way[n, 1]) / cell_m) - first[0]
            if not (0 <= r < h and 0 <= c < w) or evidence[r, c] > 0:
                is_free[n] = False
                break
    return is_free
