"""Blocks of cells: a grid sixteen times smaller, over which a search is sixteen times cheaper."""

import numpy as np
from jaxtyping import Bool

BLOCK = 4
"""Cells on each side of a block: 0.2 m. The body's clearance on both sides of a wall is wider than that, so no block
reaches through one."""


def blocks_with_any(cells: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "p q"]:
    """Return which blocks hold any of the cells; the blocks count from the first cell, the last may be cut short."""
    h, w = cells.shape
    padded = np.pad(cells, ((0, -h % BLOCK), (0, -w % BLOCK)))
    # Ten times as fast as any() over a reshaped view.
    rows = np.logical_or.reduce([padded[k::BLOCK] for k in range(BLOCK)])
    return np.asarray(np.logical_or.reduce([rows[:, k::BLOCK] for k in range(BLOCK)]))


def cells_of(blocks: Bool[np.ndarray, "p q"], shape: tuple[int, ...]) -> Bool[np.ndarray, "h w"]:
    """Return the cells of blocks, on a grid of this shape."""
    return blocks.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)[: shape[0], : shape[1]]
