"""Blocks of cells: a grid up to sixteen times smaller, over which a search is sixteen times cheaper."""

import numpy as np
from jaxtyping import Bool

MOST_CELLS = 4
"""Cells on each side of a block, at most: 0.2 m."""


def block_cells(radius_m: float, cell_m: float) -> int:
    """Return how many cells a block has on each side.

    Cells in which the body fits, on both sides of a wall, lie farther than its diameter from one another. Two blocks
    side by side are narrower than that, so they do not reach through one.
    """
    return max(min(MOST_CELLS, int((2.0 * radius_m / cell_m + 1.0) / 2.0 + 1e-9)), 1)


def blocks_with_any(cells: Bool[np.ndarray, "h w"], block: int) -> Bool[np.ndarray, "p q"]:
    """Return which blocks hold any of the cells; the blocks count from the first cell, the last may be cut short."""
    h, w = cells.shape
    padded = np.pad(cells, ((0, -h % block), (0, -w % block)))
    # Ten times as fast as any() over a reshaped view.
    rows = np.logical_or.reduce([padded[k::block] for k in range(block)])
    return np.asarray(np.logical_or.reduce([rows[:, k::block] for k in range(block)]))


def cells_of(blocks: Bool[np.ndarray, "p q"], shape: tuple[int, ...], block: int) -> Bool[np.ndarray, "h w"]:
    """Return the cells of blocks, on a grid of this shape."""
    return blocks.repeat(block, axis=0).repeat(block, axis=1)[: shape[0], : shape[1]]
