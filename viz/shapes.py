"""What is drawn, as arrays: ellipses, the model space (alpha, r), and which rows of a table have changed."""

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.lines import directions

VERTICES = 17
"""An ellipse is a closed strip of so many points, the first again at its end."""
SIGMAS = 3.0
VAGUE_RAD = float(np.deg2rad(1.0))
"""Walls of a less certain direction (short faces, seen from afar) are drawn pale: their ellipses are huge."""


def ellipses(
    centres: Float[np.ndarray, "n 2"], covs: Float[np.ndarray, "n 2 2"], times: float, vertices: int = VERTICES
) -> Float[np.ndarray, "n v 2"]:
    """Return the contours of three standard deviations, `times` enlarged, as closed strips of points."""
    turn = np.linspace(0.0, 2.0 * np.pi, vertices)
    cos, sin = np.cos(turn), np.sin(turn)
    a, b, c = covs[:, 0, 0], covs[:, 0, 1], covs[:, 1, 1]
    # The Cholesky root by hand: a covariance that lost its definiteness by rounding draws as a line, not as an error.
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
    """Return the heights raised as little as leaves those of one group `gap` or more apart, in their order."""
    moved = heights.astype(np.float64)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        rows = rows[np.argsort(heights[rows], kind="stable")]
        steps = gap * np.arange(len(rows))
        moved[rows] = np.maximum.accumulate(heights[rows] - steps) + steps
    return moved


class Changes:
    """Remembers what was last drawn of each thing, so that only what has changed is drawn again."""

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
    """Return rows of whole multiples of `quantum`, one row for each entry of the first axis."""
    return np.round(values.reshape(len(values), -1) / quantum).astype(np.int64)
