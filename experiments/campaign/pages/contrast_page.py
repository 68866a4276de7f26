"""The report of two campaigns held against each other."""

from collections.abc import Sequence
from math import isfinite, log
from pathlib import Path
from typing import Any

from chainslam.viz.reports.report import Page, PageTable, Section

from ...scoring.statistics import FEW_RUNS
from ...views.numbers import NONE, digits_apart, number
from ..comparison.comparison import Row, arm_of
from ..comparison.families import family_words, is_clear
from ..comparison.words import ARMS_SHORT, MEASURE_WORDS, interval
from ..contrast import TRIALS, read_contrast

MOST_ROWS = 60
"""Trials that are told one by one, the most different ones; `contrast.csv` has them all."""


def contrast_page(folder: Path) -> Page:
    """Return the report of a folder that `compare --against` left; raises UsageError where it is none."""
    said = read_contrast(folder)
    settings = tuple((name, *(str(value) for value in pair)) for name, pair in said["settings"].items())
    made = PageTable("Made with other settings or software", ("what", "first", "second"), settings, is_wordy=True)
    return Page(
        "Two campaigns, trial by trial",
        f"First: {said['first']}. Second: {said['second']}. Did anything change, and is it more than chance?",
        verdict(said),
        f"chainslam compare --against {said['first']} {said['second']} --out DIR",
        (),
        (
            Section("Trials", tuple(_counts(said)), (made,) if settings else ()),
            Section("Differences", _WORDS, (_differences(said["differences"]),)),
            *_trials(said["different_trials"]),
        ),
    )


_WORDS = (
    "Second against first, paired by run: the same world, start and noise. A ratio above 1, or a difference above 0, is"
    " worse than the first.",
)


def verdict(said: dict[str, Any]) -> tuple[str, ...]:
    """Return the answer, a paragraph each."""
    count = said["trials"]
    if not count["different"]:
        return (f"No: all {count['shared']} trials that both have came out the same, timings excepted.",)
    told = [row for row in said["differences"] if row["value"] is not None]
    firm = [row for row in told if row["runs"] >= FEW_RUNS]
    clear = [row for row in firm if is_clear(row)]
    first = f"Yes: {count['different']} of {count['shared']} trials that both have came out differently."
    if firm:
        first += (
            f" Of {len(firm)} means, {len(clear)} changed by more than chance (p below 0.05 after Holm's correction for"
            " all of them)."
        )
    if len(firm) < len(told):
        first += f" {len(told) - len(firm)} means of fewer than {FEW_RUNS} runs cannot be told from chance."
    worst = sorted(clear, key=_size, reverse=True)[:3]
    return (first, *map(_in_words, worst))


def _in_words(row: Row) -> str:
    value, between = _value(row)
    return f"{_subject(row)}: {value} ({between}), {row['kind']}."


def _value(row: Row) -> tuple[str, str]:
    """Return a difference and its interval, with as many digits as tell them from none."""
    told = [row[name] for name in ("value", "low", "high") if row[name] is not None]
    digits = digits_apart([*told, _none(row)])
    return number(row["value"], digits), interval(row, digits=digits)


def _none(row: Row) -> float:
    """Return what no difference is."""
    return 1.0 if row["kind"] == "ratio" else 0.0


def _size(row: Row) -> float:
    return abs(row.get("effect_size") or 0.0)


def _subject(row: Row) -> str:
    return f"{row['backend']}, {ARMS_SHORT[arm_of(row)]}, {MEASURE_WORDS[row['measure']]}"


def _counts(said: dict[str, Any]) -> Sequence[str]:
    count, changes = said["trials"], said["status"]
    words = [
        f"Both have {count['shared']} trials: {count['the_same']} the same, {count['different']} different. Only the"
        f" first has {count['only_first']}, only the second {count['only_second']} more, which are left out."
    ]
    moved = [f"{times} went {change}" for change, times in changes.items() if len(set(change.split(" -> "))) == 2]
    return [*words, f"Status: {', '.join(moved)}." if moved else "Every trial ended with the same status."]


def _differences(rows: Sequence[Row]) -> PageTable:
    header = (
        "back end",
        "arm",
        "measure",
        "kind",
        "value",
        "95 % interval",
        "effect size",
        "runs",
        "left out",
        "clear",
    )
    told = tuple(
        (
            row["backend"], ARMS_SHORT[arm_of(row)], MEASURE_WORDS[row["measure"]], row["kind"], *_value(row),
            number(row.get("effect_size"), 2), number(row["runs"]),
            number(row["pairs_without_value"]), "yes" if is_clear(row) else "",
        )
        for row in rows
        if row["value"] is not None
    )  # fmt: skip
    note = f"Left out: runs that did not complete in both, or for which one has no such value. {family_words(rows)}"
    return PageTable("Second against first", header, told, note)


def _trials(rows: Sequence[Row]) -> list[Section]:
    if not rows:
        return []
    most = sorted(rows, key=_apart, reverse=True)[:MOST_ROWS]
    header = (
        *("world", "strategy", "back end", "arm", "seed", "status", "way, m", "pose ANEES", "walls, cm"),
        "duplicate walls",
    )
    told = tuple(
        (
            row["world"], row["strategy"], row["backend"], ARMS_SHORT[arm_of(row)], str(row["seed"]),
            _pair(row, "status"), _pair(row, "path_length_m"), _pair(row, "pose_anees"),
            _pair(row, "wall_rmse_m", 100.0), _pair(row, "double_entries"),
        )
        for row in most
    )  # fmt: skip
    note = f"The {len(most)} most different of {len(rows)} by their pose ANEES; all are in {TRIALS}."
    return [Section("Trials that differ", tables=(PageTable("First, second", header, told, note),))]


def _apart(row: Row) -> float:
    """Return how far apart a trial's two results are: a status that changed before any number."""
    pair = [row[f"pose_anees_{side}"] for side in ("first", "second")]
    if row["status_first"] != row["status_second"] or any(v is None or not isfinite(v) or v <= 0 for v in pair):
        return float("inf")
    return abs(log(pair[1] / pair[0]))


def _pair(row: Row, name: str, scale: float = 1.0) -> str:
    words = [_word(row[f"{name}_{side}"], scale) for side in ("first", "second")]
    return words[0] if words[0] == words[1] else f"{words[0]}, {words[1]}"


def _word(value: Any, scale: float) -> str:
    if value is None:
        return NONE
    return value if isinstance(value, str) else number(value if scale == 1.0 else scale * value)
