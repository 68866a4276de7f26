"""Many comparisons made at once: each is held against the size of its family, so that chance alone finds none."""

from collections.abc import Iterable, Sequence
from typing import Any

from ...scoring.statistics import FEW_RUNS, holm
from ...views.numbers import number

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
    """Return whether a difference is more than chance, counting all that were looked at beside it."""
    return row.get("p_holm") is not None and row["p_holm"] < CLEAR


def family_words(rows: Sequence[Row]) -> str:
    """Return how many comparisons a family has, and how many of them are clear."""
    size = rows[0]["family"] if rows and "family" in rows[0] else 0
    if not size:
        return f"None is of {FEW_RUNS} runs or more: none is tested."
    clear = sum(map(is_clear, rows))
    return (
        f"Clear: p below {CLEAR:g} after Holm's correction for the {number(size)} comparisons of this family of"
        f" {FEW_RUNS} runs or more; {number(clear)} are."
    )
