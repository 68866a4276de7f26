"""Some steps of one back end, with shared computations of several layers."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int, UInt32

from chainslam.slam.geometry.lines import directions, normals

from .drawn_step import DrawnStep
from .recording import Timestamps

UNUSED, FUSED, NEW, REFUSED = 0, 1, 2, 3
"""Fate of a segment."""


class Block:
    """Consecutive moments; arrays over all their walls (k) or segments (s), row after row."""

    def __init__(self, rows: Sequence[DrawnStep]) -> None:
        self.rows = rows
        self.moments = Timestamps(np.array([row.index for row in rows]), np.array([row.time_s for row in rows]))
        self.poses: Float[np.ndarray, "n 3"] = np.array([row.pose for row in rows])
        self._first = np.cumsum([0, *(len(row.walls.ids) for row in rows)])

    def __len__(self) -> int:
        return len(self.rows)

    def walls_at(self, row: int) -> slice:
        """Return the slice of one row's walls in the arrays over all walls."""
        return slice(int(self._first[row]), int(self._first[row + 1]))

    @cached_property
    def colours(self) -> UInt32[np.ndarray, " k"]:
        """Colour of each wall."""
        return np.concatenate([row.walls.colours for row in self.rows])

    @cached_property
    def lines(self) -> Float[np.ndarray, "k 2"]:
        """(alpha, r) of each wall, world frame."""
        means, anchors = self._means, self._anchors
        return np.column_stack([means[:, 0], means[:, 1] + np.sum(normals(means[:, 0]) * anchors, axis=-1)])

    @cached_property
    def ends(self) -> Float[np.ndarray, "k 2 2"]:
        """First and last point of each wall, world frame, m."""
        alpha, d = self._means.T
        feet = self._anchors + d[:, None] * normals(alpha)
        extents = np.concatenate([row.walls.extents for row in self.rows])
        return feet[:, None, :] + extents[..., None] * directions(alpha)[:, None, :]

    @property
    def _means(self) -> Float[np.ndarray, "k 2"]:
        return np.concatenate([row.walls.means for row in self.rows])

    @property
    def _anchors(self) -> Float[np.ndarray, "k 2"]:
        return np.concatenate([row.walls.anchors for row in self.rows])

    @cached_property
    def row_of_segment(self) -> Int[np.ndarray, " s"]:
        """The row of each segment."""
        return np.repeat(np.arange(len(self)), [len(row.segments) for row in self.rows])

    def count(self, chosen: Int[np.ndarray, " m"] | np.ndarray) -> Int[np.ndarray, " n"]:
        """Return the number of selected segments in each row."""
        return np.bincount(self.row_of_segment[chosen], minlength=len(self))

    @cached_property
    def verdicts(self) -> tuple[Int[np.ndarray, " s"], list[str]]:
        """Fate of each segment, and its description."""
        kinds = np.zeros(len(self.row_of_segment), dtype=np.int64)
        words = [""] * len(kinds)
        first = 0
        for row in self.rows:
            for k, owner in enumerate(row.owners.tolist()):
                if owner >= 0:
                    kinds[first + k], words[first + k] = NEW, f"begins wall {owner}"
            for (k, wall), distance in zip(row.matches.pairs.tolist(), row.matches.distances.tolist(), strict=True):
                kinds[first + k], words[first + k] = FUSED, f"wall {wall}, d² {distance:.1f}"
            for k in row.matches.doubtful.tolist():
                kinds[first + k], words[first + k] = REFUSED, "in doubt"
            for k, why in row.matches.refusals.items():
                if kinds[first + k] != NEW:
                    kinds[first + k], words[first + k] = REFUSED, why
            first += len(row.segments)
        return kinds, words
