"""What a person sees of a replay held against what others measured: a table for each kind of error."""

from collections.abc import Sequence
from itertools import product
from typing import Any

from rich.table import Table

from .console import plain_console
from .progress import number


def print_references(summaries: Sequence[dict[str, Any]]) -> None:
    """Print how far each back end is from what others measured, where they did."""
    for tail in ("", "_smoothed"):
        smoothed = ", smoothed" if tail else ""
        told = [s for s in summaries if "relations" + tail in s]
        for kind, (words, scale) in _KINDS.items() if told else ():
            title = f"errors of relations{smoothed}: {words}"
            plain_console().print(_relations(title, kind, scale, [(s["backend"], s["relations" + tail]) for s in told]))
        told = [s for s in summaries if "reference" + tail in s]
        if told:
            title = f"distance from the reference path{smoothed}, m rms"
            plain_console().print(_reference(title, [(s["backend"], s["reference" + tail]) for s in told]))
    if any(s.get(key) for s in summaries for key in _NORMALISED):
        plain_console().print(_normalised(summaries))


_KINDS = {"translation_m": ("translation, m", 1.0), "rotation_rad": ("rotation, degrees", 57.29578)}
_TIMES = {"at_scans": "at scans", "interpolated": "interpolated"}


_NORMALISED = {
    "relations_normalised": "relations",
    "relations_smoothed_normalised": "relations, smoothed",
    "reference_normalised": "each step's pose, by the reference",
}
_PARTS = {"all": "", "far": ", 60 s apart"}


def _normalised(summaries: Sequence[dict[str, Any]]) -> Table:
    table = Table(title="squared errors in units of what is stated: 1 is honest, more overconfident")
    table.title_justify = "left"
    for name in ("", "count", "mean", "median", "in 95 %", "error, m", "stated, m"):
        table.add_column(name, justify="left" if not name else "right", no_wrap=bool(name))
    for summary in summaries:
        for (key, words), (part, far) in product(_NORMALISED.items(), _PARTS.items()):
            found = (summary.get(key) or {}).get(part)
            if found is not None:
                cells = [number(found[name]) for name in ("anees", "median", "in_band", "error_m", "stated_m")]
                table.add_row(f"{summary['backend']}, {words}{far}", str(found["count"]), *cells)
    return table


def _relations(title: str, kind: str, scale: float, told: Sequence[tuple[str, dict[str, Any]]]) -> Table:
    table = Table(title=title, title_justify="left")
    table.add_column("")
    for name in ("count", "mean", "median", "sd", "max"):
        table.add_column(name, justify="right", no_wrap=True)
    for name, scores in told:
        for (times, words), (part, far) in product(_TIMES.items(), (("all", ""), ("far", ", 60 s apart"))):
            found = scores[times][part]
            spread = found[kind] or {}
            cells = [number(scale * spread[key] if spread else None) for key in ("mean", "median", "sd", "max")]
            table.add_row(f"{name}, {words}{far}", str(found["count"]), *cells)
    return table


def _reference(title: str, told: Sequence[tuple[str, dict[str, Any]]]) -> Table:
    table = Table(title=title, title_justify="left")
    for name in ("", "poses", "as it is", "aligned"):
        table.add_column(name, justify="left" if not name else "right")
    for name, scores in told:
        table.add_row(name, str(scores["poses"]), number(scores["ate_m"]), number(scores["ate_aligned_m"]))
    return table
