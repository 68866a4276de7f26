"""Where a set of points fits a grid of likelihoods best: all places and turns, bounded from above block by block."""

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled


@compiled
def largest_ahead(values: Float[np.ndarray, "h w"], size: int) -> Float[np.ndarray, "h w"]:
    """Return for each cell the largest value in the square of `size` cells that begins there."""
    h, w = values.shape
    across = np.empty_like(values)
    for y in range(h):
        for x in range(w):
            most = values[y, x]
            for k in range(x + 1, min(x + size, w)):
                most = max(most, values[y, k])
            across[y, x] = most
    found = np.empty_like(values)
    for y in range(h):
        for x in range(w):
            most = across[y, x]
            for k in range(y + 1, min(y + size, h)):
                most = max(most, across[k, x])
            found[y, x] = most
    return found


@compiled
def mean_at(
    values: Float[np.ndarray, "h w"], rows: Int[np.ndarray, " n"], columns: Int[np.ndarray, " n"], dy: int, dx: int
) -> float:
    """Return the mean of the cells of all points after a shift; cells outside count as zero."""
    h, w = values.shape
    total = 0.0
    for k in range(len(rows)):
        y, x = rows[k] + dy, columns[k] + dx
        if 0 <= y < h and 0 <= x < w:
            total += values[y, x]
    return total / len(rows)


@compiled
def best_in_blocks(
    fine: Float[np.ndarray, "h w"],
    bounds: Float[np.ndarray, "h w"],
    rows: Int[np.ndarray, "a n"],
    columns: Int[np.ndarray, "a n"],
    reach: int,
    size: int,
    least: float,
    share: float,
) -> Float[np.ndarray, "m 4"]:
    """Return the best place of each block of shifts and turn that comes near the best of all: (score, turn, dy, dx).

    `rows` and `columns` are the points' cells for each of `a` turns, moved by up to `reach` cells to each side.
    Blocks that cannot reach `least`, nor `share` of the best score, are left out. `bounds` holds the largest of each
    square of `size` cells of `fine`.
    """
    blocks = (2 * reach + size) // size
    upper, of, count = np.empty(64), np.empty((64, 3), np.int64), 0
    for a in range(len(rows)):
        for i in range(blocks):
            for j in range(blocks):
                bound = mean_at(bounds, rows[a], columns[a], i * size - reach, j * size - reach)
                if bound < least:
                    continue
                if count == len(upper):
                    upper, of = np.concatenate((upper, np.empty(count))), np.concatenate((of, np.empty_like(of)))
                upper[count], of[count, 0], of[count, 1], of[count, 2] = bound, a, i, j
                count += 1
    order = np.argsort(-upper[:count])
    found = np.empty((len(order), 4))
    count, best = 0, least
    for index in order:
        if upper[index] < share * best:
            break
        a, i, j = of[index, 0], of[index, 1], of[index, 2]
        top, at_y, at_x = -1.0, 0, 0
        for dy in range(i * size - reach, min(i * size - reach + size, reach + 1)):
            for dx in range(j * size - reach, min(j * size - reach + size, reach + 1)):
                score = mean_at(fine, rows[a], columns[a], dy, dx)
                if score > top:
                    top, at_y, at_x = score, dy, dx
        if top >= least:
            found[count, 0], found[count, 1], found[count, 2], found[count, 3] = top, a, at_y, at_x
            count += 1
            best = max(best, top)
    return found[:count]
