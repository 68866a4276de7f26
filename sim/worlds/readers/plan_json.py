"""Plans as JSON: {"walls": [[x1, y1, x2, y2], ...], "start": [x, y]} in metres, doors already cut out of the walls."""

from typing import Any

import numpy as np
import shapely
from jaxtyping import Float

from ..drawing import Drawing, WorldError, as_pose, counted, numbers, shorten
from ..limits import check_count, check_labels, check_size
from ..options import AS_DRAWN, DrawingOptions
from ..text import name_of


def from_json(document: dict[str, Any], options: DrawingOptions = AS_DRAWN) -> Drawing:
    """Return the drawing of a parsed plan; `start` (2 or 3 numbers) and `labels` (name: [x, y]) are optional."""
    options.check_only(("scale",), "a plan in JSON")
    metres = 1.0 if options.scale is None else options.scale
    walls = document.get("walls")
    if not isinstance(walls, list):
        raise WorldError(f'expected "walls" to be a list of [x1, y1, x2, y2], found {shorten(walls)}: correct the file')
    check_count(len(walls))
    rows = [numbers(wall, (4,), f"wall {i}", "[x1, y1, x2, y2]") for i, wall in enumerate(walls)]
    lines = tuple(
        shapely.LineString(metres * row.reshape(2, 2)) for row in rows if row[0] != row[2] or row[1] != row[3]
    )
    start = document.get("start")
    labels = document.get("labels") or {}
    if not isinstance(labels, dict):
        raise WorldError(f'expected "labels" to be {{name: [x, y]}}, found {shorten(labels)}: correct the file')
    check_labels(labels)
    check_size(lines, ())
    points = {name_of(name): numbers(at, (2,), f"label {shorten(name)}", "[x, y]") for name, at in labels.items()}
    return Drawing(
        lines=lines,
        start=None if start is None else _scaled(numbers(start, (2, 3), "start", "[x, y] or [x, y, heading]"), metres),
        labels={name: (metres * float(at[0]), metres * float(at[1])) for name, at in points.items()},
        understood=counted(len(lines), "line as a wall", "lines as walls"),
        scale="in metres" if options.scale is None else f"{metres:.4g} m a unit, given",
    )


def _scaled(value: Float[np.ndarray, " k"], metres: float) -> Float[np.ndarray, "3"]:
    pose = as_pose(value)
    pose[:2] *= metres
    return pose
