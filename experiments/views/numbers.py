"""Numbers as a reader wants them."""

from collections.abc import Sequence

import numpy as np

NONE = "–"
ROUNDING = 1e-9
"""What is nearer to 0 than this is 0 but for rounding."""


def number(value: float | int | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, never in powers of ten; a dash for none."""
    if value is None:
        return NONE
    if isinstance(value, int) or value == 0:
        return str(int(value)) if float(value).is_integer() else str(value)
    if abs(value) < ROUNDING:
        return "0"
    short = f"{value:.{digits}g}"
    if "e+" in short or abs(value) >= 1000:
        return f"{float(short):,.0f}"
    return np.format_float_positional(float(short), trim="-") if "e-" in short else short


def digits_apart(values: Sequence[float]) -> int:
    """Return how many significant digits (3 to 6) tell numbers that differ from one another."""
    for digits in range(3, 6):
        if len({number(value, digits) for value in values}) == len(set(values)):
            return digits
    return 6


def percent(value: float | None) -> str:
    """Return a share in per cent."""
    return number(None if value is None else 100.0 * value)
