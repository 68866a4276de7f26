"""Test of the paper's hypothesis that a careful exploration strategy compensates for a weaker estimator."""

from collections.abc import Sequence
from typing import Any

from ...scoring.statistics import FEW_RUNS
from ..plan import CLOSED
from ..scores.score import END
from .comparison import BASELINE_BACKEND, BASELINE_STRATEGY, Measure, Row, difference, select

CONTENDER = ("nearest-start", "block-ekf")
MATCHES_WITHIN = 1.1
"""Two errors match if the 95 % interval of their ratio is below this, and differ if it is above."""
DECIDING = ("wall_rmse_m", "wall_shape_m")
"""Where the walls of the map lie, and its shape alone: the full EKF moves its map as a whole, which says nothing of
how well the walls lie to each other (docs/contributing/studies.md, "Bias and the precision of the scanner")."""
MARKS = ("10", "20", "33")
"""Metres driven at which both are compared; the last that any run reached decides. 33 m is the length of the paper's
first experiment."""
MEASURES = (
    Measure("wall_rmse_m", True),
    Measure("wall_shape_m", True),
    Measure("pose_error_m", True, 1e-4),
    Measure("pose_anees_so_far", True),
    Measure("uncovered", False),
)


def hypothesis(marks: Sequence[Row]) -> dict[str, Any] | None:
    """Return whether the contender matches the baseline at equal path lengths; None if either was not run."""
    closed = [row | {"uncovered": _uncovered(row)} for row in select(marks, mode=CLOSED)]
    contender = select(closed, strategy=CONTENDER[0], backend=CONTENDER[1])
    baseline = select(closed, strategy=BASELINE_STRATEGY, backend=BASELINE_BACKEND)
    if not contender or not baseline:
        return None
    found: dict[str, Any] = {
        "contender": "{} with {}".format(*CONTENDER),
        "baseline": f"{BASELINE_STRATEGY} with {BASELINE_BACKEND}",
        "matches_within": MATCHES_WITHIN,
        "decisive_mark": _last_reached(contender + baseline),
        "marks": {},
    }
    for mark in (*MARKS, END):
        first, second = (_alive(select(rows, metres=mark)) for rows in (contender, baseline))
        found["marks"][mark] = {
            "contender": _states(contender, mark),
            "baseline": _states(baseline, mark),
            **{m.name: difference(first, second, m) for m in MEASURES},
        }
    ratios = [found["marks"][found["decisive_mark"]][name] for name in DECIDING]
    enough = min(ratio["runs"] for ratio in ratios) >= FEW_RUNS
    found["verdict"] = verdict([(ratio["low"], ratio["high"]) for ratio in ratios]) if enough else "undecided"
    return found


def verdict(intervals: Sequence[tuple[float | None, float | None]]) -> str:
    """Return `matches`, `does not match` or `undecided` for the intervals of some ratios of errors.

    All must match for a match; a single one that does not decides against it.
    """
    known = [(low, high) for low, high in intervals if low is not None and high is not None]
    if any(low > MATCHES_WITHIN for low, _ in known):
        return "does not match"
    return "matches" if len(known) == len(intervals) and all(h <= MATCHES_WITHIN for _, h in known) else "undecided"


def _last_reached(rows: Sequence[Row]) -> str:
    """Return the last mark at which a run still drives; the end of the runs if none reaches the first."""
    return next((mark for mark in reversed(MARKS) if _states(rows, mark)["driving"]), END)


def _alive(rows: Sequence[Row]) -> list[Row]:
    """Return the rows, counting every run with scores at its mark as complete."""
    return [row | {"status": "failed" if row["state"] == "failed" else "complete"} for row in rows]


def _states(rows: Sequence[Row], mark: str) -> dict[str, int]:
    states = [row["state"] for row in select(rows, metres=mark)]
    return {state: states.count(state) for state in ("driving", "finished", "failed")}


def _uncovered(row: Row) -> float | None:
    return None if row.get("coverage") is None else 1.0 - row["coverage"]
