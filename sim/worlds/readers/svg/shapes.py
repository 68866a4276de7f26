"""Outlines of SVG's shapes: paths as rings of points, curves as short chords; lengths and frames."""

import math
import re
from typing import Any

import numpy as np
import shapely
import svgelements
from jaxtyping import Float

from ...drawing import WorldError, shorten
from .cascade import Style

CURVE_STEPS = 24
SHAPES = ("path", "rect", "circle", "ellipse", "line", "polyline", "polygon")
UNITS = {
    **{"": 1.0, "px": 1.0, "in": 96.0, "cm": 96 / 2.54, "mm": 96 / 25.4, "q": 96 / 101.6, "pt": 96 / 72, "pc": 16.0},
    **{"em": 16.0, "rem": 16.0, "ex": 8.0, "ch": 8.0},
}
"""Pixels, or user units, in a unit of length; letters are taken to be 16 pixels high."""
LENGTH = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([a-zA-Z]*|%)")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
Ring = Float[np.ndarray, "_ 2"]
Box = tuple[float, float, float, float]
"""x, y, width and height."""


def length(text: str, whole: float, otherwise: float = 0.0) -> float:
    """Return a length in user units, a share of `whole` where it is one; `otherwise` for no length."""
    found = LENGTH.fullmatch(text.strip())
    if found is None:
        return otherwise
    unit = found[2].lower()
    if unit == "%":
        return 0.01 * float(found[1]) * whole
    return float(found[1]) * UNITS[unit] if unit in UNITS else otherwise


def matrix(text: str) -> Any:
    """Return a transform; raises whatever the library meets in one that is none."""
    return svgelements.Matrix(text) if text and text != "none" else svgelements.Matrix()


def view(
    box: Box | None, width: float, height: float, preserve: str, x: float = 0.0, y: float = 0.0
) -> tuple[Any, Box | None]:
    """Return the transform from inside a viewport to its outside, and what of the inside can be seen."""
    moved = svgelements.Matrix.translate(x, y)
    if box is None or not (width > 0 and height > 0):
        return moved, (0.0, 0.0, width, height) if box is None else box
    sx, sy = width / box[2], height / box[3]
    words = preserve.split()
    align = words[0] if words else "xMidYMid"
    if align != "none":
        sx = sy = max(sx, sy) if "slice" in words else min(sx, sy)
    seen = width / sx, height / sy
    shares = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}
    left = box[0] - shares.get(align[1:4], 0.5) * (seen[0] - box[2]) if align != "none" else box[0]
    top = box[1] - shares.get(align[5:8], 0.5) * (seen[1] - box[3]) if align != "none" else box[1]
    inside = svgelements.Matrix.translate(-left, -top) * svgelements.Matrix.scale(sx, sy)
    return inside * moved, (left, top, *seen)


def view_box(text: str | None) -> Box | None:
    """Return a `viewBox`; raises WorldError for one that is none."""
    if text is None:
        return None
    try:
        x, y, width, height = (float(part) for part in text.replace(",", " ").split())
    except ValueError:
        x = y = width = height = math.nan
    if not (math.isfinite(x) and math.isfinite(y) and 0 < width < math.inf and 0 < height < math.inf):
        raise WorldError(f'expected viewBox="x y width height", found {shorten(text)}: correct the <svg> element')
    return x, y, width, height


def rings_of(name: str, style: Style, element: Any, frame: Any, whole: tuple[float, float]) -> list[Ring]:
    """Return the subpaths of a shape, of two points or more, in the frame of the page."""
    path = _path(name, style, element, whole)
    if path is None:
        return []
    # Points are moved, not the path: the library does not skew arcs rightly.
    linear, moved = np.array([[frame.a, frame.b], [frame.c, frame.d]]), np.array([frame.e, frame.f])
    return [ring @ linear + moved for ring in _rings(path) if len(ring) > 1]


def _path(name: str, style: Style, element: Any, whole: tuple[float, float]) -> Any:
    across, down, round_ = *whole, math.hypot(*whole) / math.sqrt(2)

    def at(key: str, of: float, otherwise: float = 0.0) -> float:
        return length(style.text(key), of, otherwise)

    match name:
        case "path":
            words = element.get("d", "")
            return svgelements.Path(words) if words.strip() not in ("", "none") else None
        case "rect":
            width, height = at("width", across), at("height", down)
            rx, ry = at("rx", across, -1.0), at("ry", down, -1.0)
            rx, ry = (ry if rx < 0 else rx, rx if ry < 0 else ry)
            if not (width > 0 and height > 0):
                return None
            radii = min(max(rx, 0.0), width / 2), min(max(ry, 0.0), height / 2)
            return svgelements.Path(svgelements.Rect(at("x", across), at("y", down), width, height, *radii))
        case "circle" | "ellipse":
            radii = (at("r", round_),) * 2 if name == "circle" else (at("rx", across, -1.0), at("ry", down, -1.0))
            radii = (radii[1] if radii[0] < 0 else radii[0], radii[0] if radii[1] < 0 else radii[1])
            if not min(radii) > 0:
                return None
            return svgelements.Path(
                svgelements.Ellipse(cx=at("cx", across), cy=at("cy", down), rx=radii[0], ry=radii[1])
            )
        case "line":
            ends = [
                length(element.get(key, ""), of) for key, of in zip(("x1", "y1", "x2", "y2"), whole * 2, strict=True)
            ]
            return svgelements.Path(svgelements.SimpleLine(*ends))
        case _:
            numbers = [float(each) for each in NUMBER.findall(element.get("points", ""))]
            points = list(zip(numbers[::2], numbers[1::2], strict=False))
            kind = svgelements.Polygon if name == "polygon" else svgelements.Polyline
            return svgelements.Path(kind(points)) if len(points) > 1 else None


def _rings(path: Any) -> list[Ring]:
    rings: list[list[list[float]]] = []
    for piece in path:
        if isinstance(piece, svgelements.Move) or not rings:
            rings.append([] if piece.end is None else [[piece.end.x, piece.end.y]])
            if isinstance(piece, svgelements.Move):
                continue
        if isinstance(piece, svgelements.Line | svgelements.Close):
            rings[-1] += [[piece.end.x, piece.end.y]] if piece.end is not None else []
        else:
            rings[-1] += piece.npoint(np.linspace(0, 1, CURVE_STEPS + 1)[1:]).tolist()
        if isinstance(piece, svgelements.Close) and piece.end is not None:
            rings.append([[piece.end.x, piece.end.y]])
    return [np.array(ring) for ring in rings if ring]


def placed(box: Box, frame: Any) -> shapely.Polygon:
    """Return a box in the frame of the page."""
    corners = [
        (box[0], box[1]),
        (box[0] + box[2], box[1]),
        (box[0] + box[2], box[1] + box[3]),
        (box[0], box[1] + box[3]),
    ]
    return shapely.Polygon([tuple(frame.point_in_matrix_space(corner)) for corner in corners])


def bounds(rings: list[Ring]) -> Box | None:
    """Return the box around rings; None for no rings."""
    if not rings:
        return None
    points = np.concatenate(rings)
    low, high = points.min(axis=0), points.max(axis=0)
    return float(low[0]), float(low[1]), float(high[0] - low[0]), float(high[1] - low[1])
