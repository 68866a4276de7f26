"""What is drawn, in the order in which it is drawn."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry

from .paint import Paint
from .winding import filled

JOINS: dict[str, Literal["mitre", "round", "bevel"]] = {
    "miter": "mitre",
    "miter-clip": "mitre",
    "arcs": "mitre",
    "round": "round",
    "bevel": "bevel",
}
CAPS: dict[str, Literal["flat", "round", "square"]] = {"butt": "flat", "round": "round", "square": "square"}


@dataclass(frozen=True, eq=False)
class Piece:
    """A fill or a stroke."""

    rings: list[Float[np.ndarray, "_ 2"]]
    paint: Paint
    rule: str | None = None
    """How rings are filled; None for a stroke."""
    width: float | None = None
    """Of a stroke; None where the drawing does not say it, which means one unit."""
    cap: str = "butt"
    join: str = "miter"
    units: float = 1.0
    """Units of the page in a unit of where the shape is drawn."""
    clip: BaseGeometry | None = None
    """All that may be seen of it; None where nothing is clipped away."""

    def area(self, width: float | None = None) -> BaseGeometry:
        """Return what is painted, a stroke in its own width or in another."""
        if self.rule is not None:
            shape: BaseGeometry = shapely.union_all(filled(self.rings, self.rule == "evenodd"))
        else:
            wide = width if width is not None else self.units if self.width is None else self.width
            lines = [shapely.LineString(ring) for ring in self.rings]
            shape = shapely.union_all(
                [line.buffer(0.5 * wide, cap_style=CAPS[self.cap], join_style=JOINS[self.join]) for line in lines]
            )
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
