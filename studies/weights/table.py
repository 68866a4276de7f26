"""The table of docs/contributing/mechanisms.md: what gets worse, or better, without each mechanism.

.venv/bin/python -m studies.weights.table
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ..runner import rows
from ..runner.command import run_study
from ..runner.marks import filled
from ..runner.rows import Row
from .mechanisms import BASELINE, MECHANISMS, Mechanism

ROWS = Path(__file__).with_name("rows.jsonl")
SETS = ("apartments", "uneven", "schools")
SURE = 2.0
"""A mean difference of more than so many of its own standard errors is told."""
LEAST_PAIRS = 5
"""Fewer differences have no standard error worth the name."""


@dataclass(frozen=True)
class Measure:
    """One score of a run."""

    words: str
    better: float
    """1 where more is better, -1 where less is."""
    is_ratio: bool = False
    """Whether runs are compared by their ratio: then the mean is that of logarithms."""


SCORES = {
    "complete": Measure("runs complete", 1.0),
    "coverage": Measure("coverage", 1.0),
    "contours_closed": Measure("contours closed", 1.0),
    "open_ends": Measure("open ends left", -1.0),
    "map_anees": Measure("map ANEES", -1.0, is_ratio=True),
    "pose_anees_from_start": Measure("pose ANEES", -1.0, is_ratio=True),
    "false_matches": Measure("false matches", -1.0),
    "duplicate_lines": Measure("duplicate walls", -1.0),
    "steps": Measure("steps", -1.0, is_ratio=True),
    "collisions": Measure("collisions", -1.0),
}


@dataclass(frozen=True)
class WeightsTable:
    """Put the table of mechanisms and their weights between two marks of a page."""

    rows: Path = ROWS
    """What `studies.weights.run` has stored."""
    page: Path = Path("docs/contributing/mechanisms.md")

    def run(self) -> None:
        """Write the page, and say how many of its rows are of an older version of the code."""
        stored = rows.read(self.rows, any_code=True)
        older = sum(row["code"] != rows.fingerprint() for row in newest(stored))
        if older:
            print(f"{older} of the rows in {self.rows} are of an older version of the code: run studies.weights.run")
        self.page.write_text(filled(self.page.read_text(), lambda _: table(stored)))


def newest(stored: Sequence[Row]) -> list[Row]:
    """Return the newest row of each mechanism and set that no later one covers, with the runs of everything on.

    A later row covers one if it has the same plans, or more; rows by other edits than today's are none.
    """
    digests = {each.name: each.digest for each in MECHANISMS}
    ours = [row for row in stored if digests.get(row["mechanism"]) == row["edits"]]
    last = [row for k, row in enumerate(ours) if not any(_covers(later, row) for later in ours[k + 1 :])]
    versions = {(row["code"], row["set"]) for row in last}
    return [row for row in stored if row in last or (not row["mechanism"] and (row["code"], row["set"]) in versions)]


def _covers(later: Row, row: Row) -> bool:
    names = ("mechanism", "set")
    return rows.key_of(later, names) == rows.key_of(row, names) and later["plans"].keys() >= row["plans"].keys()


def table(stored: Sequence[Row], mechanisms: Sequence[Mechanism] = MECHANISMS) -> str:
    """Return a row for each mechanism, in their order, with a column for each set of plans."""
    heads = ("mechanism", "what it does", *(f"without it: {plan_set}" for plan_set in SETS))
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for each in mechanisms:
        cells = (each.name, each.what, *(verdict(stored, each, plan_set) for plan_set in SETS))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def verdict(stored: Sequence[Row], mechanism: Mechanism, plan_set: str) -> str:
    """Return what is surely worse and better without a mechanism, in how many pairs of runs of one code."""
    # The newest code that has as many pairs as any.
    code, base, off = "", dict[str, dict[str, float | None]](), dict[str, dict[str, float | None]]()
    for each in dict.fromkeys(row["code"] for row in stored):
        same = [row for row in stored if row["code"] == each]
        known, without = (scores_of(same, one, plan_set) for one in (BASELINE, mechanism))
        if len(known.keys() & without.keys()) >= len(base.keys() & off.keys()):
            code, base, off = each, known, without
    plans = sorted(base.keys() & off.keys())
    if len(plans) < LEAST_PAIRS:
        return "not run yet"
    found: dict[bool, list[str]] = {False: [], True: []}
    for score, measure in SCORES.items():
        pairs = np.array([(base[plan].get(score), off[plan].get(score)) for plan in plans], dtype=np.float64)
        told = difference(pairs, measure)
        if told is not None:
            found[told[0] * measure.better > 0.0].append(f"{measure.words} {told[1]}")
    words = [f"{how}: {', '.join(told)}" for how, told in (("worse", found[False]), ("better", found[True])) if told]
    version = "" if code == rows.fingerprint() else ", older code"
    return f"{len(plans)} pairs{version}: {'; '.join(words) or 'nothing'}"


def scores_of(stored: Sequence[Row], mechanism: Mechanism, plan_set: str) -> dict[str, dict[str, float | None]]:
    """Return the scores by name of each plan of a set, run without a mechanism as it is edited now."""
    key = (mechanism.name, mechanism.digest, plan_set)
    ours = [row for row in stored if rows.key_of(row, ("mechanism", "edits", "set")) == key]
    return {
        plan: dict(zip(row["scores"], values, strict=True)) for row in ours for plan, values in row["plans"].items()
    }


def difference(pairs: Float[np.ndarray, "n 2"], measure: Measure) -> tuple[float, str] | None:
    """Return the mean difference and it in words with its standard error; None where it may be chance.

    Pairs that lack a score count for nothing.
    """
    pairs = pairs[np.all(np.isfinite(pairs) & (pairs > (0.0 if measure.is_ratio else -np.inf)), axis=1)]
    if len(pairs) < LEAST_PAIRS:
        return None
    less, more = (np.log(pairs) if measure.is_ratio else pairs).T
    mean = float((more - less).mean())
    error = float((more - less).std(ddof=1) / np.sqrt(len(pairs)))
    if abs(mean) <= max(SURE * error, 1e-12):
        return None
    if measure.is_ratio:
        return mean, f"{100.0 * np.expm1(mean):+.1f} % ± {100.0 * error:.1f}"
    return mean, f"{_rounded(mean, 2, sign=True)} ± {_rounded(error, 1)}"


def _rounded(value: float, digits: int, sign: bool = False) -> str:
    """Return a number to so many digits, without an exponent."""
    return np.format_float_positional(value, digits, unique=False, fractional=False, trim="-", sign=sign)


if __name__ == "__main__":
    run_study(WeightsTable)
