"""How likely a scan's points are where earlier scans had theirs: a grid that is 1 at their points and falls off."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..geometry.compiled import compiled

REACH_SIGMAS = 2.5
"""Beyond so many standard deviations of the kernel the field is zero."""


class LikelihoodField(NamedTuple):
    """The largest of the kernels of all points, on a grid of h x w cells; zero outside."""

    values: Float[np.ndarray, "h w"]
    """At the cells' middles."""
    corner: Float[np.ndarray, "2"]
    """Middle of the first cell, m."""
    cell_m: float
    margin: int
    """So many cells at the rim are zero: what is looked up outside is moved there."""


@compiled
def field_of(
    points: Float[np.ndarray, "n 2"],
    middle: Float[np.ndarray, "2"],
    half_m: float,
    cell_m: float,
    kernel_m: float,
    margin: int,
) -> LikelihoodField:
    """Return the field of points around a place, `half_m` to each side of it."""
    reach = int(np.ceil(REACH_SIGMAS * kernel_m / cell_m))
    rim = margin + reach
    count = 2 * int(np.ceil(half_m / cell_m)) + 1 + 2 * rim
    corner = middle - 0.5 * (count - 1) * cell_m
    values = np.zeros((count, count))
    along_x, along_y = np.empty(2 * reach + 1), np.empty(2 * reach + 1)
    for i in range(len(points)):
        x, y = (points[i, 0] - corner[0]) / cell_m, (points[i, 1] - corner[1]) / cell_m
        if not (rim <= x <= count - 1 - rim and rim <= y <= count - 1 - rim):
            continue
        first_column, first_row = int(np.rint(x)) - reach, int(np.rint(y)) - reach
        for k in range(2 * reach + 1):
            along_x[k] = np.exp(-0.5 * ((first_column + k - x) * (cell_m / kernel_m)) ** 2)
            along_y[k] = np.exp(-0.5 * ((first_row + k - y) * (cell_m / kernel_m)) ** 2)
        for j in range(2 * reach + 1):
            for k in range(2 * reach + 1):
                row, column = first_row + j, first_column + k
                values[row, column] = max(values[row, column], along_y[j] * along_x[k])
    return LikelihoodField(values, corner, cell_m, margin)


@compiled
def score(field: LikelihoodField, points_robot: Float[np.ndarray, "n 2"], x: float, y: float, heading: float) -> float:
    """Return the mean likelihood of a scan's points from a pose, linear between cells; 1 is a perfect fit."""
    rows, columns = field.values.shape
    c, s = np.cos(heading), np.sin(heading)
    total = 0.0
    for i in range(len(points_robot)):
        px, py = points_robot[i, 0], points_robot[i, 1]
        u = (c * px - s * py + x - field.corner[0]) / field.cell_m
        v = (s * px + c * py + y - field.corner[1]) / field.cell_m
        u, v = min(max(u, 0.0), columns - 1.001), min(max(v, 0.0), rows - 1.001)
        column, row = int(u), int(v)
        u, v = u - column, v - row
        low = field.values[row, column] * (1.0 - u) + field.values[row, column + 1] * u
        high = field.values[row + 1, column] * (1.0 - u) + field.values[row + 1, column + 1] * u
        total += low * (1.0 - v) + high * v
    return total / len(points_robot)
