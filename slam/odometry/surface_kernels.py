"""What the points of a scan say of its pose: how far each is off the surface that earlier points tell."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..geometry.compiled import compiled

NEAREST = 6
"""So many earlier points tell where a surface is: their mean has less noise than the nearest one."""
BUCKET_M = 0.1
"""Side of the squares by which earlier points are sorted: a wall's hold some points each."""
NOTHING_SIGMAS = 8.5
"""A point so far off its surface weighs less than a rounding error."""


class Buckets(NamedTuple):
    """Points sorted into squares: those of square k, row by row, are `points[first[k]:first[k + 1]]`."""

    points: Float[np.ndarray, "n 2"]
    first: Int[np.ndarray, " b1"]
    corner: Float[np.ndarray, "2"]
    """Of the first square, m."""
    side: int
    """Number of squares in a row, and of rows."""


@compiled
def sorted_into_buckets(points: Float[np.ndarray, "m 2"], middle: Float[np.ndarray, "2"], half_m: float) -> Buckets:
    """Return those of the points that lie within `half_m` of a place along x and y, in squares of `BUCKET_M`."""
    side = 2 * int(np.ceil(half_m / BUCKET_M))
    corner = middle[:2] - 0.5 * side * BUCKET_M
    square = np.full(len(points), -1)
    first = np.zeros(side * side + 1, np.int64)
    for i in range(len(points)):
        column = int(np.floor((points[i, 0] - corner[0]) / BUCKET_M))
        row = int(np.floor((points[i, 1] - corner[1]) / BUCKET_M))
        if 0 <= column < side and 0 <= row < side:
            square[i] = row * side + column
            first[square[i] + 1] += 1
    for k in range(side * side):
        first[k + 1] += first[k]
    ordered, at = np.empty((first[-1], 2)), first.copy()
    for i in range(len(points)):
        if square[i] >= 0:
            ordered[at[square[i]]] = points[i]
            at[square[i]] += 1
    return Buckets(ordered, first, corner, side)


@compiled
def surface_near(
    buckets: Buckets, x: float, y: float, far_m: float, squared: Float[np.ndarray, " k"], rows: Int[np.ndarray, " k"]
) -> bool:
    """Find the k points nearest to a place, all nearer than `far_m`, ring by ring; return whether there are as many.

    `rows` are theirs, `squared` the squares of their distances, m^2, nearest first.
    """
    k, side = len(rows), buckets.side
    squared[:] = np.inf
    u, v = (x - buckets.corner[0]) / BUCKET_M, (y - buckets.corner[1]) / BUCKET_M
    column, row = int(np.floor(u)), int(np.floor(v))
    inside = min(u - column, column + 1 - u, v - row, row + 1 - v) * BUCKET_M
    ring = 0
    while True:
        for j in range(max(row - ring, 0), min(row + ring, side - 1) + 1):
            is_rim = j == row - ring or j == row + ring
            for i in range(column - ring, column + ring + 1, 1 if is_rim else max(2 * ring, 1)):
                if not 0 <= i < side:
                    continue
                for point in range(buckets.first[j * side + i], buckets.first[j * side + i + 1]):
                    d2 = (buckets.points[point, 0] - x) ** 2 + (buckets.points[point, 1] - y) ** 2
                    if d2 < squared[k - 1]:
                        _insert(squared, rows, d2, point)
        seen_m = ring * BUCKET_M + inside  # no point nearer than this is left
        if squared[k - 1] <= seen_m * seen_m:
            return True
        if seen_m > far_m:
            return False
        ring += 1


@compiled
def _insert(squared: Float[np.ndarray, " k"], rows: Int[np.ndarray, " k"], d2: float, point: int) -> None:
    """Put a point where it belongs among the nearest, in place of the farthest."""
    at = len(rows) - 1
    while at > 0 and squared[at - 1] > d2:
        squared[at], rows[at] = squared[at - 1], rows[at - 1]
        at -= 1
    squared[at], rows[at] = d2, point


@compiled
def normal_equations(
    buckets: Buckets,
    points: Float[np.ndarray, "n 2"],
    normals: Float[np.ndarray, "n 2"],
    pose: Float[np.ndarray, "3"],
    sigma_m: float,
    reach_m: float,
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3"]]:
    """Return the information of a pose by points with known normals (robot frame), and the gradient at it.

    Each point says how far it is off across its surface, and nothing along it; the farther off, measured by `reach_m`,
    the less.
    """
    count = min(NEAREST, len(buckets.points))
    squared, rows = np.empty(count), np.empty(count, np.int64)
    information, gradient, row = np.zeros((3, 3)), np.zeros(3), np.empty(3)
    if count == 0:
        return information, gradient
    # One of the nearest alone may be far: their mean is nearer by as many times as there are.
    far_m = count * NOTHING_SIGMAS * reach_m
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(len(points)):
        arm_x, arm_y = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
        x, y = arm_x + pose[0], arm_y + pose[1]
        if not surface_near(buckets, x, y, far_m, squared, rows):
            continue
        off_x, off_y = -x, -y
        for k in range(count):
            off_x += buckets.points[rows[k], 0] / count
            off_y += buckets.points[rows[k], 1] / count
        row[0], row[1] = c * normals[i, 0] - s * normals[i, 1], s * normals[i, 0] + c * normals[i, 1]
        row[2] = row[1] * arm_x - row[0] * arm_y
        left = row[0] * off_x + row[1] * off_y
        weight = np.exp(-0.5 * (off_x * off_x + off_y * off_y) / (reach_m * reach_m)) / (sigma_m * sigma_m)
        for j in range(3):
            gradient[j] += weight * row[j] * left
            for k in range(3):
                information[j, k] += weight * row[j] * row[k]
    return information, gradient
