"""The points of a scan in the order of their beams: thinned, joined along surfaces, and how these run."""

import numpy as np
from jaxtyping import Bool, Float

from ..geometry.compiled import compiled

BESIDE = 3
"""Points on either side of one that tell how its surface runs: of one alone, noise would tell it."""


@compiled
def joined(points: Float[np.ndarray, "n 2"], every_m: float, gap_m: float) -> Float[np.ndarray, "m 2"]:
    """Return points in the order of their beams with others between neighbours that are nearer than `gap_m`."""
    n = len(points)
    pieces = np.ones(n, np.int64)
    for i in range(n - 1):
        apart = np.hypot(points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1])
        if apart < gap_m:
            pieces[i] = int(np.ceil(apart / every_m))
    whole = np.empty((pieces.sum(), 2))
    at = 0
    for i in range(n):
        for k in range(pieces[i]):
            share = k / pieces[i]
            for axis in range(2):
                off = points[i + 1, axis] - points[i, axis] if k else 0.0
                whole[at, axis] = points[i, axis] + share * off
            at += 1
    return whole


@compiled
def surface_normals(
    points: Float[np.ndarray, "n 2"], gap_m: float
) -> tuple[Float[np.ndarray, "n 2"], Bool[np.ndarray, " n"]]:
    """Return for points in the order of their beams the unit normal of the surface, and whether it can be told."""
    n = len(points)
    normals, known = np.zeros((n, 2)), np.zeros(n, np.bool_)
    whole = 0  # so many points up to this one follow each other without a gap
    for last in range(n):
        before = max(last - 1, 0)
        apart = np.hypot(points[last, 0] - points[before, 0], points[last, 1] - points[before, 1])
        whole = whole + 1 if apart < gap_m else 1
        if whole <= 2 * BESIDE:
            continue
        i = last - BESIDE
        x = (points[i + 1 : last + 1, 0].sum() - points[i - BESIDE : i, 0].sum()) / BESIDE
        y = (points[i + 1 : last + 1, 1].sum() - points[i - BESIDE : i, 1].sum()) / BESIDE
        length = max(np.hypot(x, y), 1e-9)
        normals[i, 0], normals[i, 1], known[i] = -y / length, x / length, True
    return normals, known


@compiled
def thinned(points: Float[np.ndarray, "n 2"], cell_m: float) -> Float[np.ndarray, "m 2"]:
    """Return the last of the points in each cell, the latest first; the cells taken are found by a table of hashes."""
    n = len(points)
    size = 8
    while size < 2 * n:
        size *= 2
    holder = np.full(size, -1)
    cells, kept, count = np.empty((n, 2), np.int64), np.empty((n, 2)), 0
    for i in range(n - 1, -1, -1):
        x, y = int(np.floor(points[i, 0] / cell_m)), int(np.floor(points[i, 1] / cell_m))
        mixed = x * 40503 + y * 2654435769
        slot = (mixed ^ (mixed >> 15)) & (size - 1)
        while holder[slot] >= 0 and not (cells[holder[slot], 0] == x and cells[holder[slot], 1] == y):
            slot = (slot + 1) & (size - 1)
        if holder[slot] < 0:
            holder[slot] = count
            cells[count, 0], cells[count, 1] = x, y
            kept[count] = points[i]
            count += 1
    return kept[:count].copy()
