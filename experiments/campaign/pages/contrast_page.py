"""The report of two campaigns compared trial by trial."""

from collections.abc import Callable, Sequence
from math import isfinite, log
from pathlib import Path
from typing import Any

from chainslam.viz.reports.report import Page, PageTable, Section, table
from chainslam.viz.text import NONE

from ...scoring.statistics import FEW_RUNS
from ...views.numbers import number
from ..comparison.comparison import Row, arm_of
from ..comparison.families import CLEAR, is_clear
from ..contrast import TRIALS, read_contrast
from .tables import differences, text

MOST_ROWS = 60
"""Number of trials that the page lists, those that differ most; `contrast.csv` contains all."""
SIDES = {"status": ("status", 1.0), "path length, m": ("path_length_m", 1.0), "pose ANEES": ("pose_anees", 1.0),
         "wall error, cm": ("wall_rmse_m", 100.0), "duplicate walls incl. merged": ("double_entries", 1.0)}  # fmt: skip
"""Columns that exist for both campaigns: key without the campaign, and factor."""
NOTE = (
    "Second compared with first, paired by run (the same world, start and noise): a ratio above 1 or a difference above"
    f" 0 is worse than the first. p is corrected by Holm's method; fewer than {FEW_RUNS} runs are not tested. Left out:"
    " runs that failed in one of both or lack the value."
)


def contrast_page(folder: Path) -> Page:
    """Return the report of a folder of `compare --against`; raises UsageError for another folder."""
    said = read_contrast(folder)
    told = [row | {"arm": arm_of(row)} for row in said["differences"]]
    changes = {"from": lambda item: item[0].partition(" -> ")[0], "to": lambda item: item[0].partition(" -> ")[2]}
    status = table("Status", changes | {"trials": lambda item: number(item[1])}, list(said["status"].items()))
    settings = PageTable(
        "Settings and software that differ", ("setting", "first", "second"),
        tuple((name, *map(str, pair)) for name, pair in said["settings"].items()),
    )  # fmt: skip
    means = differences("Means", told, {"estimator": "backend", "arm": "arm"})
    sections = (Section("Means", (NOTE,), (means,)), *_trials(said["different_trials"]))
    return Page(
        "Two campaigns, trial by trial",
        (*lines_of_contrast(said), f"First: {said['first']}. Second: {said['second']}."),
        f"chainslam compare --against {said['first']} {said['second']} --out DIR",
        (),
        sections=(*sections, Section("Trials", tables=tuple(each for each in (status, settings) if each.rows))),
    )


def lines_of_contrast(said: Row) -> tuple[str, ...]:
    """Return the differences, and which means differ significantly."""
    count = said["trials"]
    told = [row for row in said["differences"] if row["value"] is not None]
    tested = [row for row in told if row["runs"] >= FEW_RUNS]
    clear = sum(map(is_clear, tested))
    lone = f"{count['only_first']} only in the first, {count['only_second']} only in the second"
    return (
        f"{count['different']} of {count['shared']} shared trials differ ({lone}).",
        f"{clear} of {len(tested)} means differ by more than chance (p < {CLEAR} after Holm's correction); too few runs"
        f" for {len(told) - len(tested)}.",
    )


def _trials(rows: Sequence[Row]) -> list[Section]:
    if not rows:
        return []
    names = {"world": "world", "strategy": "strategy", "estimator": "backend", "arm": "arm", "seed": "seed"}
    columns = {name: text(key) for name, key in names.items()}
    columns |= {words: _pair(key, scale) for words, (key, scale) in SIDES.items()}
    most = [row | {"arm": arm_of(row)} for row in sorted(rows, key=_apart, reverse=True)[:MOST_ROWS]]
    words = f"First, second: the {len(most)} most different of {len(rows)} by pose ANEES; {TRIALS} has all."
    return [Section("Trials that differ", (words,), (table("Trials that differ", columns, most),))]


def _apart(row: Row) -> float:
    """Return how much a trial's two results differ; a changed status comes before any number."""
    pair = [row[f"pose_anees_{side}"] for side in ("first", "second")]
    if row["status_first"] != row["status_second"] or any(v is None or not isfinite(v) or v <= 0 for v in pair):
        return float("inf")
    return abs(log(pair[1] / pair[0]))


def _pair(name: str, scale: float) -> Callable[[Row], str]:
    def shown(row: Row) -> str:
        words = [_word(row[f"{name}_{side}"], scale) for side in ("first", "second")]
        return words[0] if words[0] == words[1] else f"{words[0]}, {words[1]}"

    return shown


def _word(value: Any, scale: float) -> str:
    if value is None:
        return NONE
    return value if isinstance(value, str) else number(value if scale == 1.0 else scale * value)
