"""The output of every reader of drawings: walls as lines, solids as polygons, an optional start and named points."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float

from .text import printable

SMALLEST_M, LARGEST_M = 1.0, 1000.0
"""A drawing outside of these extents has the wrong scale."""


class WorldError(ValueError):
    """A map that cannot be used. The message is one line: what was expected, what was found, what to do."""

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


@dataclass(frozen=True, eq=False)
class Drawing:
    """A map as drawn, in metres in the world frame (x right, y up), before walls get a thickness."""

    lines: tuple[shapely.LineString, ...] = ()
    """Walls drawn as lines, each without thickness."""
    solids: tuple[shapely.Polygon, ...] = ()
    """Filled obstacles."""
    start: Float[np.ndarray, "3"] | None = None
    """Start pose (x m, y m, heading rad) where the drawing names one."""
    labels: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Named points."""
    openings: tuple[shapely.Polygon, ...] = ()
    """Doors: solid parts there are removed, unless that would open the building to its outside."""
    sheet: shapely.Polygon | None = None
    """The border of a picture: it bounds the free space, since nothing is known beyond it."""
    simplify_m: float = 0.012
    """Smaller deviations from straight lines are considered unintended."""
    understood: str = ""
    """How parts were interpreted, in words."""
    notes: tuple[str, ...] = ()
    """Parts that were left out or not understood, in words."""
    scale: str = ""
    """The unit and its source, in words."""


def numbers(value: Any, counts: tuple[int, ...], what: str, example: str) -> Float[np.ndarray, " k"]:
    """Return JSON numbers as an array; raise WorldError unless they are finite and as many as one of `counts`."""
    good = isinstance(value, list | tuple) and len(value) in counts
    if good and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value):
        try:
            array = np.array([float(v) for v in value])
        except OverflowError:
            array = np.array([np.inf])
        if np.all(np.isfinite(array)):
            return array
    raise WorldError(
        f"expected {what} to be finite numbers such as {example}, found {shorten(value)}: correct the file"
    )


def as_pose(value: Float[np.ndarray, " k"]) -> Float[np.ndarray, "3"]:
    """Return (x, y) or (x, y, heading) as a pose, heading 0 where none is given."""
    return np.array([value[0], value[1], value[2] if len(value) > 2 else 0.0])


def counted(count: int, one: str, many: str) -> str:
    """Return a number of things in words, nothing for none of them."""
    return "" if not count else f"{count} {one if count == 1 else many}"


def shorten(value: Any) -> str:
    """Return a value as one short line for a message."""
    text = repr(value) if not isinstance(value, dict | list) or len(value) < 50 else type(value).__name__
    return text if len(text) <= 60 else text[:57] + "..."
