"""Blocks of cells: none so large that two of them, side by side, reach through a wall."""

import numpy as np
import pytest

from chainslam.explore.planning.grid_kernels import (
    MOST_CELLS,
    block_cells,
    blocks_with_any,
    cells_of,
    metres_from,
    outwards,
)

CELL_M = 0.05


@pytest.mark.parametrize("radius_m", [0.03, 0.05, 0.1, 0.134, 0.15, 0.2, 0.3, 0.4])
def test_two_blocks_side_by_side_are_narrower_than_the_body_or_the_body_is_narrower_than_a_cell(radius_m):
    block = block_cells(radius_m, CELL_M)
    assert 1 <= block <= MOST_CELLS
    # From the middle of the first cell to that of the last one.
    assert block == 1 or (2 * block - 1) * CELL_M <= 2.0 * radius_m + 1e-9
    assert block == MOST_CELLS or (2 * (block + 1) - 1) * CELL_M > 2.0 * radius_m


@pytest.mark.parametrize("block", [1, 2, 3, 4])
def test_blocks_hold_what_their_cells_hold(block):
    cells = np.random.default_rng(block).random((13, 18)) < 0.1
    blocks = blocks_with_any(cells, block)
    again = cells_of(blocks, cells.shape, block)
    assert again.shape == cells.shape
    assert np.all(again[cells])
    for row, column in np.argwhere(blocks):
        assert cells[row * block : (row + 1) * block, column * block : (column + 1) * block].any()


def test_a_field_goes_on_outwards_at_a_set_cost():
    metres = np.full((5, 6, 2), np.inf)
    metres[2, 1, 0] = 1.0
    off = abs(np.indices((5, 6)) - np.array([2, 1])[:, None, None]).sum(axis=0)
    wide = outwards(metres, 3, 0.25)
    assert np.array_equal(wide[..., 0], np.where(off <= 3, 1.0 + 0.25 * off, np.inf))
    assert np.all(wide[..., 1] == np.inf)


def test_metres_are_the_least_of_those_of_the_nine_blocks_around():
    rng = np.random.default_rng(3)
    metres, places = rng.uniform(0.0, 3.0, (6, 9)), rng.uniform(-3.0, 11.0, (200, 2))
    for place, found in zip(places, metres_from(metres, places, 0.2), strict=True):
        own = np.clip(np.floor(place).astype(int), -1, (4, 7)) + 1
        blocks = [(r, c) for r, c in np.ndindex(6, 9) if max(abs(r - own[0]), abs(c - own[1])) <= 1]
        assert found == min(metres[block] + 0.2 * np.hypot(*(place - (np.array(block) - 0.5))) for block in blocks)
