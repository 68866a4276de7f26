"""Comparison of a replay with measurements of its drive: loop errors, and their stated covariance."""

from collections.abc import Iterator, Sequence
from itertools import product
from math import degrees
from typing import Any

from chainslam.viz.reports.report import PageTable, table

from ..scenario import OFFLINE
from .numbers import number, percent

Row = dict[str, Any]
PATHS = {"": "at each step", "_smoothed": "smoothed"}
TIMES = {"at_scans": "at scans", "interpolated": "interpolated"}
PARTS = {"all": "", "far": ", 60 s apart"}
STATED = {
    "relations_normalised": "relations", "relations_smoothed_normalised": "relations, smoothed",
    "reference_normalised": "reference path",
}  # fmt: skip


def measured_tables(summaries: Sequence[Row]) -> dict[str, PageTable]:
    """Return the tables, without rows that were not measured."""
    names = {name: (lambda row, name=name: row[name]) for name in ("estimator", "path", "relations")}
    spread = {
        f"{words} {name}": (lambda row, kind=kind, name=name, turn=turn: _spread(row[kind], name, turn))
        for words, kind, turn in (("m,", "translation_m", False), ("degrees,", "rotation_rad", True))
        for name in ("mean", "median", "max")
    }
    counted = {"count": lambda row: number(row["count"])}
    return {
        "relations": table("Errors of relations", names | counted | spread, list(_relations(summaries))),
        "reference": table("Distance from the reference path", {
            "estimator": lambda row: row["estimator"], "path": lambda row: row["path"],
            "poses": lambda row: number(row["poses"]), "as it is, m": lambda row: number(row["ate_m"]),
            "aligned, m": lambda row: number(row["ate_aligned_m"]),
        }, list(_references(summaries))),
        "stated": table("Stated covariance", {
            "estimator": lambda row: row["estimator"], "compared with": lambda row: row["what"], **counted,
            "ANEES": lambda row: number(row["anees"]), "median": lambda row: number(row["median"]),
            "in the 95 % band, %": lambda row: percent(row["in_band"]), "error, m": lambda row: number(row["error_m"]),
            "stated, m": lambda row: number(row["stated_m"]),
        }, list(_stated(summaries))),
    }  # fmt: skip


def _spread(found: Row | None, name: str, turn: bool) -> str:
    return number(None if found is None else degrees(found[name]) if turn else found[name])


def _relations(summaries: Sequence[Row]) -> Iterator[Row]:
    for named, scores in _scores(summaries, "relations"):
        for (times, words), (part, far) in product(TIMES.items(), PARTS.items()):
            yield {**named, "relations": words + far, **scores[times][part]}


def _references(summaries: Sequence[Row]) -> Iterator[Row]:
    for named, scores in _scores(summaries, "reference"):
        yield {**named, **scores}


def _scores(summaries: Sequence[Row], kind: str) -> Iterator[tuple[Row, Row]]:
    """Yield the scores of each path of each run; without a back end there is one path, the smoothed one."""
    for summary, (tail, path) in product(summaries, PATHS.items()):
        scores, smoothed = summary.get(kind + tail), summary.get(f"{kind}_smoothed")
        if scores and not (summary["backend"] == OFFLINE and smoothed and not tail):
            yield {"estimator": summary["backend"], "path": path}, scores


def _stated(summaries: Sequence[Row]) -> Iterator[Row]:
    for summary, (key, what), (part, far) in product(summaries, STATED.items(), PARTS.items()):
        if (found := (summary.get(key) or {}).get(part)) is not None:
            yield {"estimator": summary["backend"], "what": what + far, **found}
