"""What is drawn, in the order in which it is drawn."""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry

from .paint import Paint

JOINS: dict[str, Literal["mitre", "round", "bevel"]] = {
    "miter": "mitre",
    "miter-clip": "mitre",
    "arcs": "mitre",
    "round": "round",
    "bevel": "bevel",
}
CAPS: dict[str, Literal["flat", "round", "square"]] = {"butt": "flat", "round": "round", "square": "square"}

MITRE = 4.0
"""Of SVG, where nothing else is said: sharper corners are cut off."""


@dataclass(frozen=True, eq=False)
class Piece:
    """A fill or a stroke."""

    rings: list[Float[np.ndarray, "_ 2"]]
    paint: Paint
    rule: str | None = None
    """How rings are filled; None for a stroke."""
    width: float | None = None
    """Of a stroke, where it is drawn; None where the drawing does not say it, which means one unit."""
    cap: str = "butt"
    join: str = "miter"
    pen: Float[np.ndarray, "2 2"] = field(default_factory=lambda: np.eye(2))
    """From where the shape is drawn to the page, for points as rows: it turns and skews what a pen draws."""
    clip: BaseGeometry | None = None
    """All that may be seen of it; None where nothing is clipped away."""

    @property
    def page_width(self) -> float | None:
        """The width of a stroke on the page, on the mean; None where the drawing does not say it."""
        return None if self.width is None else self.width * math.sqrt(abs(float(np.linalg.det(self.pen))))

    def area(self) -> BaseGeometry:
        """Return what is painted."""
        if self.rule is not None:
            shape: BaseGeometry = shapely.union_all(filled(self.rings, self.rule == "evenodd"))
        else:
            inverse = np.linalg.pinv(self.pen)
            lines = [shapely.LineString(ring @ inverse) for ring in self.rings]
            wide = 1.0 if self.width is None else self.width
            cap, join = CAPS[self.cap], JOINS[self.join]
            drawn = [line.buffer(0.5 * wide, cap_style=cap, join_style=join, mitre_limit=MITRE) for line in lines]
            shape = shapely.transform(shapely.union_all(drawn), lambda at: at @ self.pen)
        return shape if self.clip is None else shape.intersection(self.clip)


@dataclass(frozen=True, eq=False)
class Group:
    """What is drawn apart, and then laid on what is below as one picture."""

    opacity: float
    pieces: "list[Piece | Group]" = field(default_factory=list)


def leaves(pieces: "list[Piece | Group]", opacity: float = 1.0) -> list[Piece]:
    """Return the fills and strokes in drawing order, as faint as the groups around them make them."""
    result: list[Piece] = []
    for each in pieces:
        if isinstance(each, Group):
            result += leaves(each.pieces, opacity * each.opacity)
        else:
            result.append(each if opacity == 1.0 else replace(each, paint=each.paint.faded(opacity)))
    return result


def filled(rings: list[Float[np.ndarray, "_ 2"]], even_odd: bool) -> list[shapely.Polygon]:
    """Return the polygons that a drawing program fills inside rings (closed where open), by winding number."""
    closed = [np.concatenate([ring, ring[:1]]) for ring in rings if len(ring) > 2]
    if not closed:
        return []
    cells = shapely.get_parts(shapely.polygonize([shapely.union_all(shapely.linestrings(ring)) for ring in closed]))
    if len(closed) > 1 or len(cells) > 1 or not len(cells):
        noded = shapely.node(shapely.multilinestrings([shapely.LineString(ring) for ring in closed]))
        cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    inside = shapely.get_coordinates(shapely.point_on_surface(cells))
    turns = np.sum([_turns(ring, inside) for ring in closed], axis=0)
    keep = turns % 2 == 1 if even_odd else turns != 0
    merged = shapely.get_parts(shapely.union_all(cells[keep]))
    return [part for part in merged if part.geom_type == "Polygon"]


def _turns(ring: Float[np.ndarray, "n 2"], points: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, " m"]:
    """Return how often a closed ring winds around each point."""
    (x0, y0), (x1, y1) = ring[:-1].T[:, None, :], ring[1:].T[:, None, :]
    x, y = points[:, :1], points[:, 1:]
    left = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
    up, down = (y0 <= y) & (y1 > y) & (left > 0), (y0 > y) & (y1 <= y) & (left < 0)
    turns: Float[np.ndarray, " m"] = np.sum(up, axis=1, dtype=float) - np.sum(down, axis=1, dtype=float)
    return turns
