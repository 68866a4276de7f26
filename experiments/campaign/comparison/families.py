"""Correction of p-values for the number of comparisons that are made at once."""

from collections.abc import Iterable, Sequence
from typing import Any

from ...scoring.statistics import FEW_RUNS, holm

Row = dict[str, Any]
CLEAR = 0.05


def in_family(rows: Iterable[Row]) -> list[Row]:
    """Return comparisons with `p_holm`, their p-value as corrected for the family, and `family`, how many it has.

    Those of fewer than `FEW_RUNS` runs are not tested and do not count: None.
    """
    found = list(rows)
    tested = [k for k, row in enumerate(found) if row.get("p") is not None and row["runs"] >= FEW_RUNS]
    corrected = dict(zip(tested, holm([found[k]["p"] for k in tested]).tolist(), strict=True))
    return [row | {"p_holm": corrected.get(k), "family": len(tested)} for k, row in enumerate(found)]


def is_clear(row: Row) -> bool:
    """Return whether a difference is significant, after correction for all comparisons of its family."""
    return row.get("p_holm") is not None and row["p_holm"] < CLEAR


def family_of(rows: Sequence[Row]) -> tuple[int, int]:
    """Return how many comparisons of a family are tested, and how many of them are significant."""
    return (rows[0].get("family") or 0 if rows else 0), sum(map(is_clear, rows))
