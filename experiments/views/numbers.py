"""Readable numbers: three significant digits, no powers of ten, intervals in brackets."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from chainslam.viz.text import NONE

ROUNDING = 1e-9
"""Values nearer to 0 than this are 0 up to rounding."""
WITHIN, BUILDINGS = ("low", "high"), ("low_buildings", "high_buildings")
"""Keys of the ends of an interval: for other runs, and for other buildings."""


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, a count with all of them; a dash for none."""
    if value is None:
        return NONE
    if isinstance(value, int):
        return f"{value:,}"
    if abs(value) < ROUNDING:
        return "0"
    short = f"{value:#.{digits}g}".rstrip(".")
    if abs(float(short)) >= 1000:
        return f"{float(short):,.0f}"
    return np.format_float_positional(float(short), trim="-") if "e" in short else short


def digits_apart(values: Sequence[float]) -> int:
    """Return the number of significant digits (3 to 6) that distinguishes different numbers."""
    for digits in range(3, 6):
        if len({number(value, digits) for value in values}) == len(set(values)):
            return digits
    return 6


def percent(value: float | None) -> str:
    """Return a share in per cent."""
    return number(None if value is None else 100.0 * value)


def interval(found: Mapping[str, Any], scale: float = 1.0, digits: int = 3, ends: tuple[str, str] = WITHIN) -> str:
    """Return the 95 % interval of an estimate or a difference; empty if there is none, or all values are equal."""
    if any(found.get(end) is None for end in ends) or found[ends[0]] == found[ends[1]]:
        return ""
    return " to ".join(number(scale * found[end], digits) for end in ends)


def estimated(found: Mapping[str, Any] | None, scale: float = 1.0, digits: int = 3) -> str:
    """Return the mean of an estimate, or the value of a difference, with its interval in brackets."""
    value = None if found is None else found.get("mean", found.get("value"))
    if found is None or value is None:
        return NONE
    within = interval(found, scale, digits)
    return number(scale * value, digits) + (f" ({within})" if within else "")


def listed(words: Sequence[str]) -> str:
    """Return words as a list in a sentence."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def markdown(table: Iterable[Sequence[str]]) -> str:
    """Return a table as Markdown; its first row holds the names of the columns."""
    head, *lines = ["| " + " | ".join(cells) + " |" for cells in table]
    return "\n".join([head, "|" + "---|" * (head.count(" | ") + 1), *lines])
