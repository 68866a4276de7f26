"""What a dimension is, and its value with the standard deviation that the joint covariance gives it (delta method).

A dimension says between which walls and corners it is taken, and no more: of the true lines it has the true value.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import count
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from chainslam.slam.estimation.backend import POSE
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import wrap

from ...scoring.maps.measurements import Measured, area, distance, perimeter
from .faces import Faces, Node
from .sight import FACING_RAD, Pair


class Kind(StrEnum):
    """What is measured."""

    WIDTH = "width"
    """Between two walls that face each other."""
    OVERALL = "overall"
    """Between the outermost faces that look at each other, whatever stands in between."""
    THICKNESS = "thickness"
    """Of a wall of which both faces were seen."""
    LENGTH = "length"
    """Of a wall between its two corners."""
    OPENING = "opening"
    """A door, a window or a passage, between the ends of walls."""
    AREA = "area"
    """Of a room, closed over its openings."""
    PERIMETER = "perimeter"
    """Of the same outline, openings counted."""


@dataclass(frozen=True)
class Dimension:
    """One dimension of a map."""

    kind: Kind
    at_world: Float[np.ndarray, "2"]
    """Where it is drawn, m; a distance between walls is taken here."""
    ends_world: Float[np.ndarray, "2 2"]
    """Between which points, m; twice `at_world` for areas and perimeters."""
    measured: Measured
    walls: tuple[int, ...]
    """Rows of the walls that it is between, or that surround it."""
    nodes: tuple[tuple[Node, ...], ...] = field(default=())
    """Its two nodes as one ring, or the rings of a room, its outline first; none between walls."""
    overlap_m: float = 0.0
    """How much of the two walls face each other."""
    is_firm: bool = True
    """Whether all its ends are corners, which the joint covariance knows."""

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return "m²" if self.kind is Kind.AREA else "m"


def between_walls(faces: Faces, kind: Kind, pair: Pair) -> Dimension:
    """Return the distance between two parallel walls, or the thickness of the wall whose two faces they are."""
    measured = across(faces, kind, pair.first, pair.second, pair.at_world)
    rows = pair.first, pair.second
    feet = [pair.at_world + _off(faces, row, pair.at_world) * normals(faces.means[row, 0]) for row in rows]
    return Dimension(kind, pair.at_world, np.array(feet), measured, rows, overlap_m=pair.overlap_m)


def between_nodes(faces: Faces, kind: Kind, first: Node, second: Node) -> Dimension:
    """Return the distance between two nodes."""
    measured = distance(faces.points([first, second]), 0, 1)
    ends = np.array([faces.place(first), faces.place(second)])
    return Dimension(
        kind, ends.mean(axis=0), ends, measured, walls_of([first, second]), ((first, second),),
        is_firm=are_firm([first, second]),
    )  # fmt: skip


def value_of(faces: Faces, dimension: Dimension) -> Measured:
    """Return what a dimension of one map is by other lines of the same walls, such as the true ones."""
    match dimension.kind:
        case Kind.WIDTH | Kind.OVERALL | Kind.THICKNESS:
            first, second = dimension.walls
            return across(faces, dimension.kind, first, second, dimension.at_world)
        case Kind.LENGTH | Kind.OPENING:
            return distance(faces.points(dimension.nodes[0]), 0, 1)
        case Kind.AREA:
            return area_of(faces, dimension.nodes)
        case Kind.PERIMETER:
            return perimeter(faces.points(dimension.nodes[0]), range(len(dimension.nodes[0])))


def across(faces: Faces, kind: Kind, first: int, second: int, at_world: Float[np.ndarray, "2"]) -> Measured:
    """Return how far apart two walls are at a point."""
    total, gradient = apart(faces, kind, first, second, at_world)
    return Measured(total, float(np.sqrt(max(gradient @ faces.cov @ gradient, 0.0))))


def apart(
    faces: Faces, kind: Kind, first: int, second: int, at_world: Float[np.ndarray, "2"]
) -> tuple[float, Float[np.ndarray, " s"]]:
    """Return how far apart two walls are at a point, e = d + n·(c - p) of each, with its derivative by the state:
    de = t·(c - p) dalpha + dd.
    """
    sign = -1.0 if kind is Kind.THICKNESS else 1.0
    gradient, total = np.zeros(POSE + 2 * len(faces)), 0.0
    for row in (first, second):
        arm = faces.anchors[row] - at_world
        total += sign * _off(faces, row, at_world)
        gradient[POSE + 2 * row : POSE + 2 * row + 2] += sign * directions(faces.means[row, 0]) @ arm, sign
    return total, gradient


def area_of(faces: Faces, rings: Sequence[Sequence[Node]]) -> Measured:
    """Return the area inside the first ring less those of the others, which lie in it."""
    points, numbers = faces.points([node for ring in rings for node in ring]), count()
    return area(points, *([next(numbers) for _ in ring] for ring in rings))


def commonest(
    alpha: Float[np.ndarray, " n"], lengths_m: Float[np.ndarray, " n"]
) -> tuple[float, Float[np.ndarray, " n"]]:
    """Return the direction modulo 90 degrees that the greatest length of lines is parallel to, as their mean by length,
    and the weight of each line in it: walls that stand askew have none.
    """
    if not len(alpha):
        return 0.0, np.zeros(0)
    near = np.abs(_quarter(alpha[:, None] - alpha[None, :])) <= FACING_RAD
    seed = int(np.argmax(near @ lengths_m))
    share = np.where(near[seed], lengths_m, 0.0)
    off = float(share @ _quarter(alpha - alpha[seed])) / max(float(share.sum()), 1e-12)
    return float(_quarter(alpha[seed] + off)), share


def _quarter(rad: np.ndarray | float) -> Any:
    """Return angles modulo 90 degrees, from -45 to 45."""
    return wrap(4.0 * np.asarray(rad)) / 4.0


def main_direction(faces: Faces, among: Bool[np.ndarray, " n"] | None = None) -> Measured:
    """Return the direction (rad, from -45 to 45 degrees) of most of the walls modulo 90 degrees, by their lengths.

    Only those walls count that are `among` some; all by default.
    """
    lengths = faces.lengths_m if among is None else np.where(among, faces.lengths_m, 0.0)
    phi, share = commonest(faces.means[:, 0], lengths)
    gradient = np.zeros(POSE + 2 * len(faces))
    gradient[POSE::2] = share / max(float(share.sum()), 1e-12)
    return Measured(phi, float(np.sqrt(max(gradient @ faces.cov @ gradient, 0.0))))


def walls_of(nodes: Sequence[Node]) -> tuple[int, ...]:
    """Return the rows of the walls of some nodes, each once, in their order."""
    return tuple(dict.fromkeys(row for node in nodes for row in (node.wall, node.other) if row >= 0))


def are_firm(nodes: Sequence[Node]) -> bool:
    """Return whether all nodes are corners."""
    return all(node.other >= 0 for node in nodes)


def _off(faces: Faces, row: int, at_world: Float[np.ndarray, "2"]) -> float:
    """Return how far in front of a wall a point is, m."""
    alpha, r = faces.lines_world[row]
    return float(r - normals(alpha) @ at_world)
