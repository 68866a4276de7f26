"""Blocks of cells: none so large that two of them, side by side, reach through a wall."""

import numpy as np
import pytest

from chainslam.explore.planning.coarse_grid import MOST_CELLS, block_cells, blocks_with_any, cells_of

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
