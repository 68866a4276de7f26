"""Loops over the cells of the grid of free floor."""

import math
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.compiled import compiled

Box: TypeAlias = tuple[int, int, int, int]
"""First and end row, first and end column."""
HALF_DIAGONAL = 0.71
"""From the middle of a cell of side one to its corner: no part of a free cell lies beyond a beam's end."""


@compiled
def take_in(
    evidence: Int[np.ndarray, "h w"],
    beyond: Bool[np.ndarray, "h w"],
    first: Int[np.ndarray, "2"],
    pose_world: Float[np.ndarray, "3"],
    body_world: Float[np.ndarray, "2"],
    bearings_rad: Float[np.ndarray, " k"],
    shown_m: Float[np.ndarray, " k"],
    is_hit: Bool[np.ndarray, " k"],
    is_full_turn: bool,
    cell_m: float,
    spare_m: float,
    body_m: float,
    hit: int,
    limit: int,
) -> Box:
    """Take one scan into the grid, and return the part of it in which cells became occupied or ceased to be.

    The pose is the scanner's; `first` is the column and row of the grid's first cell in the world. Each cell before the
    nearer of the two beams beside it, or within the body, loses one; each that was hit gains `hit`. `spare_m` is how
    far free floor may lie beyond all tips of the beams.
    """
    x, y, heading = pose_world
    beams = len(bearings_rad)
    ux, uy = np.empty(beams + 1), np.empty(beams + 1)
    rows, columns = np.empty(beams, dtype=np.int64), np.empty(beams, dtype=np.int64)
    for k in range(beams):
        ux[k], uy[k] = math.cos(heading + bearings_rad[k]), math.sin(heading + bearings_rad[k])
        columns[k] = math.floor((x + shown_m[k] * ux[k]) / cell_m) - first[0]
        rows[k] = math.floor((y + shown_m[k] * uy[k]) / cell_m) - first[1]
    ux[beams], uy[beams] = ux[0], uy[0]
    row, column = math.floor(y / cell_m) - first[1], math.floor(x / cell_m) - first[0]
    spare = math.ceil(spare_m / cell_m) + 1
    r0, r1 = min(rows.min(), row) - spare, max(rows.max(), row) + spare + 1
    c0, c1 = min(columns.min(), column) - spare, max(columns.max(), column) + spare + 1
    before = evidence[r0:r1, c0:c1].copy()
    # From the scanner to the middle of the first cell there, in cells.
    x0, y0 = c0 + first[0] + 0.5 - x / cell_m, r0 + first[1] + 0.5 - y / cell_m
    for k in range(beams if is_full_turn else beams - 1):
        depth = min(shown_m[k], shown_m[(k + 1) % beams]) / cell_m - HALF_DIAGONAL
        if depth > 0.0:
            _free_between(evidence, before, r0, c0, x0, y0, ux[k], uy[k], ux[k + 1], uy[k + 1], depth, limit)
    off_x, off_y = x0 + (x - body_world[0]) / cell_m, y0 + (y - body_world[1]) / cell_m
    _free_body(evidence, before, r0, c0, off_x, off_y, body_m / cell_m, limit)
    for k in range(beams):
        if is_hit[k]:
            evidence[rows[k], columns[k]] = min(before[rows[k] - r0, columns[k] - c0] + hit, limit)
    return _changed(evidence, before, beyond, r0, c0, limit)


@compiled
def _free_between(
    evidence: Int[np.ndarray, "h w"],
    before: Int[np.ndarray, "p q"],
    r0: int,
    c0: int,
    x0: float,
    y0: float,
    ax: float,
    ay: float,
    bx: float,
    by: float,
    depth: float,
    limit: int,
) -> None:
    """Take one from the cells between the directions a and b, less than half a turn on, that are nearer than a depth.

    Of the cells at a height y those left of a lie on one side of x = y ax / ay, those right of b on one side of
    x = y bx / by. All lengths are in cells.
    """
    low, high = min(0.0, depth * ay, depth * by), max(0.0, depth * ay, depth * by)
    if ax > 0.0 >= bx and ay + by > 0.0:
        high = depth
    if ax < 0.0 <= bx and ay + by < 0.0:
        low = -depth
    slope_a, slope_b = ax / ay, bx / by
    for r in range(max(math.ceil(low - y0), 0), min(math.floor(high - y0) + 1, before.shape[0])):
        y, left, right = y0 + r, 0, before.shape[1] - 1
        if ay > 0.0:
            right = min(right, math.floor(y * slope_a - x0))
        elif ay < 0.0:
            left = max(left, math.ceil(y * slope_a - x0))
        elif ax * y < 0.0:
            continue
        if by > 0.0:
            left = max(left, math.floor(y * slope_b - x0) + 1)
        elif by < 0.0:
            right = min(right, math.ceil(y * slope_b - x0) - 1)
        elif bx * y >= 0.0:
            continue
        if left > right:
            continue
        half = math.sqrt(max(depth * depth - y * y, 0.0))
        for c in range(max(left, math.ceil(-half - x0)), min(right, math.floor(half - x0)) + 1):
            evidence[r0 + r, c0 + c] = max(before[r, c] - 1, -limit)


@compiled
def _free_body(
    evidence: Int[np.ndarray, "h w"],
    before: Int[np.ndarray, "p q"],
    r0: int,
    c0: int,
    x0: float,
    y0: float,
    radius: float,
    limit: int,
) -> None:
    """Take one from the cells within the body, too, and count those that lie within it whole as free; all in cells."""
    first_r, first_c, side = math.floor(-radius - y0), math.floor(-radius - x0), math.ceil(2.0 * radius) + 2
    for r in range(max(first_r, 0), min(first_r + side, before.shape[0])):
        for c in range(max(first_c, 0), min(first_c + side, before.shape[1])):
            away = math.hypot(x0 + c, y0 + r)
            if away < radius:
                less = max(before[r, c] - 1, -limit)
                evidence[r0 + r, c0 + c] = min(less, -1) if away < radius - HALF_DIAGONAL else less


@compiled
def _changed(
    evidence: Int[np.ndarray, "h w"],
    before: Int[np.ndarray, "p q"],
    beyond: Bool[np.ndarray, "h w"],
    r0: int,
    c0: int,
    limit: int,
) -> Box:
    """Occupy what lies beyond the fence, and return where cells became occupied or ceased to be, an empty box if none.

    `beyond` has no cells where there is no fence.
    """
    height, width = before.shape
    top, bottom, left, right = evidence.shape[0], 0, evidence.shape[1], 0
    for r in range(height):
        now, then, changed = evidence[r0 + r, c0 : c0 + width], before[r], 0
        if beyond.size:
            for c in range(width):
                if beyond[r0 + r, c0 + c]:
                    now[c] = limit
        for c in range(width):
            changed += (then[c] > 0) != (now[c] > 0)
        if changed:
            top, bottom = min(top, r0 + r), r0 + r + 1
            for c in range(width):
                if (then[c] > 0) != (now[c] > 0):
                    left, right = min(left, c0 + c), max(right, c0 + c + 1)
    return top, bottom, left, right


@compiled
def squared_distances(occupied: Bool[np.ndarray, "h w"], reach: int) -> Int[np.ndarray, "h w"]:
    """Return the squared distance, in cells, from each cell to the nearest occupied one; (reach + 1)^2 beyond reach."""
    height, width = occupied.shape
    far = reach + 1
    rows = np.empty((height, width), dtype=np.int32)  # distance along the column
    for r in range(height):
        for c in range(width):
            rows[r, c] = 0 if occupied[r, c] else far
    for r in range(1, height):
        for c in range(width):
            rows[r, c] = min(rows[r, c], rows[r - 1, c] + 1)
    for r in range(height - 2, -1, -1):
        for c in range(width):
            rows[r, c] = min(rows[r, c], rows[r + 1, c] + 1)
    squared = np.full((height, width), far * far, dtype=np.int32)
    padded = np.full(width + 2 * reach, far * far, dtype=np.int32)
    for r in range(height):
        for c in range(width):
            padded[reach + c] = rows[r, c] * rows[r, c]
        for off in range(2 * reach + 1):
            beside, along = padded[off : off + width], np.int32((off - reach) ** 2)
            for c in range(width):
                squared[r, c] = min(squared[r, c], beside[c] + along)
    return squared
