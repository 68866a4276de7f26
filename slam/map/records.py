"""One record of each wall: a row of a table, whatever is known of the wall, from its first observation to its end.

Each kind of evidence stands in a file of its own and declares the columns that it keeps here. A wall's row begins, is
merged into another and ends here and nowhere else, so that nothing of a wall is lost or left behind.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Int

from .kernels.record_kernels import rows_of


@dataclass(frozen=True)
class Merger:
    """Two landmarks of the map that are one wall: the rows, and how the dropped one lies to the kept one."""

    keep: int
    """Row."""
    drop: int
    """Row."""
    shift_m: float
    """Along the kept wall, from its anchor to the dropped one's."""


class Records:
    """Columns over the walls of one map, in ascending order of ids."""

    def __init__(self) -> None:
        self.ids = np.zeros(0, dtype=np.int64)
        self.columns: dict[str, Any] = {}
        self._blanks: dict[str, Any] = {}
        self._mergers: list[Callable[[Merger], None]] = []

    def __len__(self) -> int:
        return len(self.ids)

    def declare(self, merge: Callable[[Merger], None] | None = None, **blanks: Any) -> None:
        """Add columns, with what a new wall has in each; `merge` is called before the row of a dropped wall goes."""
        for name, blank in blanks.items():
            self._blanks[name] = blank
            self.columns[name] = _filled(blank, len(self))
        if merge is not None:
            self._mergers.append(merge)

    def rows(self, ids: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
        """Return the rows of walls, -1 for -1 (none); those that have none yet begin theirs."""
        rows, all_known = rows_of(self.ids, ids)
        if not all_known:
            self._begin(np.setdiff1d(ids[ids >= 0], self.ids))
            rows, _ = rows_of(self.ids, ids)
        return rows

    def _begin(self, ids: Int[np.ndarray, " m"]) -> None:
        everyone = np.concatenate([self.ids, ids])
        order = np.argsort(everyone, kind="stable")
        self.ids = everyone[order]
        for name, column in self.columns.items():
            self.columns[name] = np.concatenate([column, _filled(self._blanks[name], len(ids))])[order]

    def remove(self, ids: Int[np.ndarray, " m"]) -> None:
        """End the records of walls."""
        kept = ~np.isin(self.ids, ids)
        self.ids = self.ids[kept]
        for name, column in self.columns.items():
            self.columns[name] = column[kept]

    def merge(self, keep: int, drop: int, shift_m: float) -> None:
        """Make one record of those of two ids: evidence adds up."""
        row, other = self.rows(np.array([keep, drop])).tolist()
        for merge in self._mergers:
            merge(Merger(row, other, shift_m))
        self.remove(np.array([drop]))


def _filled(blank: Any, count: int) -> Any:
    """Return a column of so many rows that hold what a new wall has."""
    if blank is None:
        return np.empty(count, dtype=object)
    value = np.asarray(blank)
    return np.tile(value, (count, *[1] * value.ndim)).reshape(count, *value.shape)
