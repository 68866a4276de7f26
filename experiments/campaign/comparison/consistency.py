"""Consistency of an estimator: its ANEES of pose and map, with an interval, compared with 1."""

from typing import Any

from ...scoring.statistics import FEW_RUNS
from ...views.numbers import number

Row = dict[str, Any]
SCORES = {"pose_anees_from_start": "pose", "map_anees": "map"}
"""What must be consistent: the map, and the pose relative to the start, whose own error is unobservable."""
WITHIN = 1.5
"""Largest mean ANEES of a consistent estimator; the smallest is its inverse."""
CONSISTENT, OVERCONFIDENT, CAUTIOUS, TOO_FEW = "consistent", "overconfident", "too cautious", "too few runs"
UNSTATED = "no covariance stated"


def consistency(row: Row) -> Row:
    """Return the `verdict` on the scores of some runs, by which `factor` they are off, and of `what` (pose or map).

    The worse of pose and map decides. The factor is the mean ANEES of an overconfident estimator, the inverse of it for
    one that is too cautious, else None.
    """
    if row.get("sound") and row.get("trace_least", 0.0) is None:  # of an estimator that is an external program
        return {"verdict": UNSTATED, "factor": None, "what": None}
    judged = {what: (judge(row[name]), row[name]) for name, what in SCORES.items() if row.get(name) is not None}
    for verdict in (OVERCONFIDENT, TOO_FEW, CAUTIOUS, CONSISTENT):
        means = {what: estimate["mean"] for what, (said, estimate) in judged.items() if said == verdict}
        if means:
            what = max(means, key=lambda each: means[each] if verdict != CAUTIOUS else -means[each])
            factor = {OVERCONFIDENT: means[what], CAUTIOUS: 1.0 / means[what] if means[what] else None}.get(verdict)
            return {"verdict": verdict, "factor": factor, "what": None if factor is None else what}
    return {"verdict": TOO_FEW, "factor": None, "what": None}


def judge(estimate: Row) -> str:
    """Return the verdict on a mean ANEES by its 95 % interval: by run, or by building if there is none by run."""
    suffix = "" if estimate["low"] is not None else "_buildings"
    low, high = estimate[f"low{suffix}"], estimate[f"high{suffix}"]
    if low is None or estimate["runs"] < FEW_RUNS:
        return TOO_FEW
    if low >= 1.0 / WITHIN and high <= WITHIN:
        return CONSISTENT
    if low > 1.0 and estimate["mean"] > WITHIN:
        return OVERCONFIDENT
    return CAUTIOUS if high < 1.0 and estimate["mean"] < 1.0 / WITHIN else TOO_FEW


def in_words(row: Row) -> str:
    """Return a readable verdict, with three digits of the factor."""
    if row["verdict"] == OVERCONFIDENT:
        return f"overconfident by a factor of {number(row['factor'])}"
    return "too few runs to tell" if row["verdict"] == TOO_FEW else str(row["verdict"])
