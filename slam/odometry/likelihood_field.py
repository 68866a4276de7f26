"""How likely a scan's points are where earlier scans had theirs: a grid that is 1 at their points and falls off."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

REACH_SIGMAS = 2.5
"""Beyond so many standard deviations of the kernel the field is zero."""


@dataclass(frozen=True)
class LikelihoodField:
    """The largest of the kernels of all points, on a grid of h x w cells; zero outside."""

    values: Float[np.ndarray, "h w"]
    """At the cells' middles."""
    corner: Float[np.ndarray, "2"]
    """Middle of the first cell, m."""
    cell_m: float
    margin: int
    """So many cells at the rim are zero: what is looked up outside is moved there."""

    def cells(self, points: Float[np.ndarray, "*n 2"]) -> tuple[Int[np.ndarray, "*n"], Int[np.ndarray, "*n"]]:
        """Return row and column of the nearest cell of each point, at least a margin from the rim."""
        at = np.rint((points - self.corner) / self.cell_m).astype(np.int32)
        rows, columns = self.values.shape
        m = self.margin
        return np.clip(at[..., 1], m, rows - 1 - m), np.clip(at[..., 0], m, columns - 1 - m)

    def at(self, points: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n"]:
        """Return the field at points, linear between the middles of cells."""
        rows, columns = self.values.shape
        x, y = np.moveaxis((points - self.corner) / self.cell_m, -1, 0)
        x, y = np.clip(x, 0.0, columns - 1.001), np.clip(y, 0.0, rows - 1.001)
        i, j = x.astype(np.int32), y.astype(np.int32)
        u, v = x - i, y - j
        flat, first = self.values.ravel(), j * columns + i
        low = flat[first] * (1.0 - u) + flat[first + 1] * u
        high = flat[first + columns] * (1.0 - u) + flat[first + columns + 1] * u
        return np.asarray(low * (1.0 - v) + high * v)


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
    count = 2 * int(np.ceil(half_m / cell_m)) + 1 + 2 * (margin + reach)
    corner = middle - 0.5 * (count - 1) * cell_m
    values = np.zeros((count, count))
    at = (points - corner) / cell_m
    rim = margin + reach
    near = np.all((at >= rim) & (at <= count - 1 - rim), axis=1)
    at = at[near]
    whole = np.rint(at).astype(np.int64)
    steps = np.arange(-reach, reach + 1)
    off = whole[:, :, None] + steps - at[:, :, None]
    weights = np.exp(-0.5 * (off * (cell_m / kernel_m)) ** 2)
    index = (whole[:, 1, None] + steps)[:, :, None] * count + (whole[:, 0, None] + steps)[:, None, :]
    np.maximum.at(values.reshape(-1), index.ravel(), (weights[:, 1, :, None] * weights[:, 0, None, :]).ravel())
    return LikelihoodField(values, corner, cell_m, margin)


def joined(points: Float[np.ndarray, "n 2"], every_m: float, gap_m: float) -> Float[np.ndarray, "m 2"]:
    """Return points in the order of their beams with others between neighbours that are nearer than `gap_m`."""
    off = np.diff(points, axis=0)
    apart = np.hypot(off[:, 0], off[:, 1])
    pieces = np.where(apart < gap_m, np.ceil(apart / every_m), 1.0).astype(np.int64)
    row = np.repeat(np.arange(len(pieces)), pieces)
    share = (np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces)) / pieces[row]
    return np.concatenate([points[row] + share[:, None] * off[row], points[-1:]])


BESIDE = 3
"""Points on either side of one that tell how its surface runs: of one alone, noise would tell it."""


def surface_normals(
    points: Float[np.ndarray, "n 2"], gap_m: float
) -> tuple[Float[np.ndarray, "n 2"], Bool[np.ndarray, " n"]]:
    """Return for points in the order of their beams the unit normal of the surface, and whether it can be told."""
    n = len(points)
    if n <= 2 * BESIDE:
        return np.zeros((n, 2)), np.zeros(n, dtype=bool)
    rows = np.arange(n)[:, None] + np.arange(1, BESIDE + 1)
    after, before = points[np.minimum(rows, n - 1)].mean(axis=1), points[np.maximum(rows[:, ::-1] - BESIDE - 1, 0)]
    along = after - before.mean(axis=1)
    length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
    apart = np.append(np.hypot(*np.diff(points, axis=0).T), np.inf) < gap_m
    whole = np.convolve(apart, np.ones(2 * BESIDE), "valid") >= 2 * BESIDE
    known = np.zeros(n, dtype=bool)
    known[BESIDE : BESIDE + len(whole)] = whole[: n - BESIDE]
    known[n - BESIDE :] = False
    return np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None], known


def thinned(points: Float[np.ndarray, "n 2"], cell_m: float) -> Float[np.ndarray, "m 2"]:
    """Return the last of the points in each cell."""
    cells = np.floor(points / cell_m).astype(np.int64)
    keys = cells[::-1, 0] * 2**32 + cells[::-1, 1]
    return points[::-1][np.sort(np.unique(keys, return_index=True)[1])]
