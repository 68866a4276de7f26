"""Whether a rule is missed: runs without it against runs with it, plan by plan."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Row = dict[str, Any]
BASELINE = ""
SURE = 3.0
"""A mean difference of so many of its own standard errors ends a rule's study early ..."""
LIKELY = 2.0
"""... and of so many counts as worse at the end: kept rather than deleted by mistake."""
LEAST_PLANS = 5
"""Fewer differences have no standard error worth the name."""


@dataclass(frozen=True)
class Measure:
    """One figure of a run: the larger, the worse."""

    name: str
    of: Any
    """From a row to the figure, or None."""
    slack: float
    """Mean differences below this matter to nobody."""


def _figure(key: str, sign: float = 1.0, log: bool = False) -> Any:
    def of(row: Row) -> float | None:
        value = row.get(key)
        if value is None:
            return None
        return sign * float(np.log(max(float(value), 1e-3)) if log else value)

    return of


def _steps(row: Row) -> float | None:
    return float(np.log(row["steps"])) if row["status"] == "complete" else None


MEASURES = (
    Measure("coverage", _figure("coverage_own_frame", -1.0), 0.0005),
    Measure("contours closed", _figure("contours_closed", -1.0), 0.02),
    Measure("map ANEES", _figure("map_anees", log=True), 0.02),
    Measure("pose ANEES", _figure("pose_anees", log=True), 0.02),
    Measure("duplicate lines", _figure("duplicate_lines"), 0.05),
    Measure("false matches", _figure("false_matches"), 0.1),
    Measure("false mergers", _figure("false_merges"), 0.02),
    Measure("collisions", _figure("collisions"), 0.0),
    Measure("steps", _steps, 0.005),
)
LOST_COVERAGE = 0.05
"""A run that covers so much less is an incident of its own."""


@dataclass(frozen=True)
class Worse:
    """What got worse, in words, and how sure that is."""

    what: str
    sigmas: float


def changes(rows: Sequence[Row], rule: str) -> tuple[list[Row], list[Row]]:
    """Return the rows with all rules and without this one of the plans that have both, run by the same code."""
    base = {(row["code"], row["plan"]): row for row in rows if row["rule"] == BASELINE}
    off = {(row["code"], row["plan"]): row for row in rows if row["rule"] == rule}
    both = sorted(base.keys() & off.keys())
    return [base[key] for key in both], [off[key] for key in both]


def worse(rows: Sequence[Row], rule: str) -> list[Worse]:
    """Return what is worse without a rule, the surest first; incidents have infinitely many sigmas."""
    base, off = changes(rows, rule)
    found = [Worse(words, np.inf) for words in incidents(base, off)]
    for measure in MEASURES:
        pairs = [(measure.of(one), measure.of(other)) for one, other in zip(base, off, strict=True)]
        more = np.array([b - a for a, b in pairs if a is not None and b is not None])
        if len(more) < LEAST_PLANS or more.mean() <= measure.slack:
            continue
        sigmas = more.mean() / max(more.std(ddof=1) / np.sqrt(len(more)), 1e-9)
        found.append(Worse(f"{measure.name} {_words(measure, more, base, off)}", float(min(sigmas, 99.0))))
    return sorted(found, key=lambda each: -each.sigmas)


def _words(measure: Measure, more: np.ndarray, base: list[Row], off: list[Row]) -> str:
    if measure.name in ("map ANEES", "pose ANEES", "steps"):
        return f"{100.0 * np.expm1(more.mean()):+.0f} %"
    if measure.name == "coverage":
        return f"{-more.mean():+.4f}"
    before, after = (sum(abs(measure.of(row) or 0.0) for row in rows) for rows in (base, off))
    return f"{before:.0f} to {after:.0f}"


def incidents(base: Sequence[Row], off: Sequence[Row]) -> list[str]:
    """Return runs that ended worse: not complete, a collision, much less covered."""
    found = []
    for one, other in zip(base, off, strict=True):
        if one["status"] == "complete" and other["status"] != "complete":
            found.append(f"{other['plan']} {other['status']}: {other['reason']}"[:100])
        elif (other["collisions"] or 0) > (one["collisions"] or 0):
            found.append(f"{other['plan']}: {other['collisions']} collisions")
        elif (one["coverage_own_frame"] or 0.0) - (other["coverage_own_frame"] or 0.0) > LOST_COVERAGE:
            found.append(
                f"{other['plan']}: coverage {one['coverage_own_frame']:.3f} to {other['coverage_own_frame']:.3f}"
            )
    return found


def is_clearly_worse(rows: Sequence[Row], rule: str) -> bool:
    """Return whether nothing more need be run to know that a rule is missed."""
    found = worse(rows, rule)
    return sum(np.isinf(each.sigmas) for each in found) >= 2 or any(SURE < each.sigmas < np.inf for each in found)
