"""Shapes as arrays: ellipses, the model space (alpha, r), and the rows of a table that have changed."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.lines import directions

VERTICES = 17
"""Number of points of an ellipse, a closed strip whose first point is repeated at its end."""
SIGMAS = 3.0
VAGUE_RAD = float(np.deg2rad(1.0))
"""Walls with a less certain direction (short, or seen from far away) are drawn pale, since their ellipses are huge."""


def with_gaps(path_world: Float[np.ndarray, "s d"], carried: Bool[np.ndarray, " s"] | None) -> Float[np.ndarray, "m d"]:
    """Return a path with a row of NaN before each step to which the robot was carried: there nothing was driven."""
    return path_world if carried is None else np.insert(path_world, np.flatnonzero(carried), np.nan, axis=0)


def ellipses(
    centres: Float[np.ndarray, "n 2"], covs: Float[np.ndarray, "n 2 2"], times: float, vertices: int = VERTICES
) -> Float[np.ndarray, "n v 2"]:
    """Return 3 sigma ellipses, enlarged by `times`, as closed strips of points."""
    turn = np.linspace(0.0, 2.0 * np.pi, vertices)
    cos, sin = np.cos(turn), np.sin(turn)
    a, b, c = covs[:, 0, 0], covs[:, 0, 1], covs[:, 1, 1]
    # The Cholesky root in closed form: a covariance that is indefinite by rounding is drawn as a line.
    first = np.sqrt(np.maximum(a, 0.0))
    cross = np.divide(b, first, out=np.zeros_like(b), where=first > 0.0)
    last = np.sqrt(np.maximum(c - cross**2, 0.0))
    x = first[:, None] * cos
    y = cross[:, None] * cos + last[:, None] * sin
    return centres[:, None, :] + SIGMAS * times * np.stack([x, y], axis=-1)


def hessian_cov(
    alpha: Float[np.ndarray, " n"], anchors: Float[np.ndarray, "n 2"], covs: Float[np.ndarray, "n 2 2"]
) -> Float[np.ndarray, "n 2 2"]:
    """Return covariances of (alpha, r), r = d + n(alpha)·c, from those of (alpha, d) about anchors c."""
    arm = np.sum(directions(alpha) * anchors, axis=-1)
    moved = covs.copy()
    moved[:, 1, 0] += arm * covs[:, 0, 0]
    moved[:, 0, 1] = moved[:, 1, 0]
    moved[:, 1, 1] += 2.0 * arm * covs[:, 0, 1] + arm**2 * covs[:, 0, 0]
    return moved


def spread(heights: Float[np.ndarray, " k"], groups: Int[np.ndarray, " k"], gap: float) -> Float[np.ndarray, " k"]:
    """Return heights in their order, raised as little as possible so that those of a group are `gap` or more apart."""
    moved = heights.astype(np.float64)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        rows = rows[np.argsort(heights[rows], kind="stable")]
        steps = gap * np.arange(len(rows))
        moved[rows] = np.maximum.accumulate(heights[rows] - steps) + steps
    return moved


class Changes:
    """Remembers what was drawn last, so that only changes are drawn again."""

    def __init__(self, width: int) -> None:
        self._ids = np.zeros(0, dtype=np.int64)
        self._last = np.zeros((0, width), dtype=np.int64)

    def among(self, ids: Int[np.ndarray, " k"], values: Int[np.ndarray, "k w"]) -> Bool[np.ndarray, " k"]:
        """Return which rows (in order of time) differ from the row before of the same id, or are its first."""
        all_ids = np.concatenate([self._ids, ids])
        table = np.concatenate([self._last, values])
        order = np.argsort(all_ids, kind="stable")
        by_id, rows = all_ids[order], table[order]
        same_id = by_id[1:] == by_id[:-1]
        differs = np.ones(len(order), dtype=bool)
        differs[1:] = ~same_id | np.any(rows[1:] != rows[:-1], axis=1)
        is_last = np.append(~same_id, True)[: len(order)]
        known = len(self._ids)
        self._ids, self._last = by_id[is_last], rows[is_last]
        changed = np.zeros(len(order), dtype=bool)
        changed[order] = differs
        return changed[known:]

    def forget(self, ids: Int[np.ndarray, " k"]) -> None:
        """Forget things that are gone."""
        keep = ~np.isin(self._ids, ids)
        self._ids, self._last = self._ids[keep], self._last[keep]


def rounded(values: Float[np.ndarray, "..."], quantum: float) -> Int[np.ndarray, "k w"]:
    """Return rows rounded to multiples of `quantum`, one row for each entry of the first axis."""
    return np.round(values.reshape(len(values), math.prod(values.shape[1:])) / quantum).astype(np.int64)
