"""Interpretation of polygons as rooms, walls or objects in a room, and which of their parts are solid.

A polygon may be the floor of a room or the wall around it. If the file does not say which, position and width decide:

- inside another polygon, or inside an area that walls enclose and that has other floor, it is a solid object;
- otherwise, together with those that it touches, it is a room if most of it is wider than any wall, else a wall.

A room is free up to its outline; its holes, and everything around it, are solid.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from .drawing import WorldError
from .world import ROBOT_RADIUS_M

Kind = Literal["room", "solid"]
WALL_M = 0.1
BROAD_M = 1.0
"""No wall is broader than this over most of its area."""
SHUT_M = 0.02
"""Rooms nearer to each other than this are meant to touch."""
NEAR_M = 1e-3
MITRE = 10.0
APART_MAX = 300
"""Every polygon is compared with all others."""


@dataclass(frozen=True, eq=False)
class Outline:
    """A polygon as drawn, m, and what the file says that it is, if it says so."""

    polygon: shapely.Polygon
    kind: Kind | None = None


@dataclass(frozen=True, eq=False)
class Plan:
    """What polygons mean."""

    solids: tuple[shapely.Polygon, ...]
    """All that is solid, the walls around rooms among it."""
    rooms: int
    """How many of the polygons were taken for rooms."""


def plan_of(outlines: Sequence[Outline], lines: Sequence[shapely.LineString]) -> Plan:
    """Return what the polygons of a drawing mean beside the walls drawn as lines; raises WorldError for too many."""
    drawn = [(part, outline.kind) for outline in outlines for part in areas(shapely.make_valid(outline.polygon))]
    said: dict[Kind | None, list[shapely.Polygon]] = {None: [], "room": [], "solid": []}
    for part, kind in drawn:
        said[kind].append(part)
    walls = shapely.union_all([*(line.buffer(0.5 * WALL_M, quad_segs=1) for line in lines), *said["solid"]])
    inner, outer = _nested(said[None], said["room"])
    rooms, solids = list(said["room"]), [*said["solid"], *inner]
    pieces = areas(shapely.union_all(outer))
    if len(pieces) > APART_MAX:
        raise WorldError(
            f"expected at most {APART_MAX} separate polygons that do not say what they are, found"
            f" {len(pieces)}: give them a property kind, room or solid"
        )
    drawn_all = shapely.union_all([walls, *pieces])
    enclosures = [_Enclosure.of(part, drawn_all) for part in areas(drawn_all)]
    for piece in pieces:
        stands_there = any(_has_floor_beside(piece, part, drawn_all) for part in enclosures)
        (rooms if not stands_there and 2 * _opened_area(piece) > piece.area else solids).append(piece)
    among = shapely.STRtree(rooms)
    count = sum(bool(len(among.query(part.representative_point(), "intersects"))) for part in [*said["room"], *outer])
    return Plan((*solids, *_around(rooms, walls)), count)


def areas(shape: BaseGeometry) -> list[shapely.Polygon]:
    """Return the polygons of a geometry, dropping points and lines."""
    parts = shapely.get_parts(shapely.get_parts(shape))
    return [part for part in parts if part.geom_type == "Polygon" and part.area > 0]


def _nested(
    unsaid: list[shapely.Polygon], rooms: list[shapely.Polygon]
) -> tuple[list[shapely.Polygon], list[shapely.Polygon]]:
    """Return which polygons lie inside a larger one or its holes, and which in none."""
    hulls = [_filled(polygon) for polygon in (*unsaid, *rooms)]
    tree = shapely.STRtree([hull.buffer(NEAR_M, quad_segs=1) for hull in hulls])
    size = np.array([hull.area for hull in hulls])
    first, second = tree.query(np.array(hulls[: len(unsaid)], dtype=object), predicate="covered_by")
    inside = np.zeros(len(hulls), dtype=bool)
    # Of two that are drawn twice the second lies in the first.
    larger = (size[second] > size[first]) | ((size[second] == size[first]) & (second < first))
    inside[first[larger & (first != second)]] = True
    return ([p for p, is_in in zip(unsaid, inside, strict=False) if is_in],
            [p for p, is_in in zip(unsaid, inside, strict=False) if not is_in])  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Enclosure:
    """A connected part of all that is drawn, and the room to drive inside its outline."""

    part: shapely.Polygon
    hull: BaseGeometry
    room: BaseGeometry

    @classmethod
    def of(cls, part: shapely.Polygon, drawn: BaseGeometry) -> "_Enclosure":
        hull = _filled(part)
        # A lone block encloses nothing, and most parts are lone blocks.
        room = hull.difference(drawn).buffer(-ROBOT_RADIUS_M) if part.interiors else shapely.Polygon()
        return cls(part, hull.buffer(NEAR_M, quad_segs=1), room)


def _has_floor_beside(piece: shapely.Polygon, around: _Enclosure, drawn: BaseGeometry) -> bool:
    """Return whether a piece lies inside an enclosure, which need not be its own, that has floor beside it."""
    if not around.hull.covers(piece):
        return False
    if not around.part.covers(piece.representative_point()):
        return not around.room.difference(_filled(piece)).is_empty
    # Walls touch the piece: they enclose it only if they do so without it.
    others = [_Enclosure.of(part, drawn) for part in areas(around.part.difference(piece))]
    return any(part.hull.covers(piece) and not part.room.difference(_filled(piece)).is_empty for part in others)


def _opened_area(piece: shapely.Polygon) -> float:
    half = 0.5 * BROAD_M
    return float(piece.buffer(-half, join_style="mitre").buffer(half, join_style="mitre").intersection(piece).area)


def _around(rooms: list[shapely.Polygon], walls: BaseGeometry) -> list[shapely.Polygon]:
    """Return what is solid because rooms end there: their holes, and a wall around all that no walls surround yet."""
    if not rooms:
        return []
    floor = shapely.union_all(rooms)
    if len(rooms) > 1:
        closed = floor.buffer(SHUT_M, join_style="mitre", mitre_limit=MITRE)
        floor = floor.union(closed.buffer(-SHUT_M, join_style="mitre", mitre_limit=MITRE))
    surrounded = shapely.union_all([_filled(part) for part in areas(walls)])
    solid = []
    for part in areas(floor):
        hull = _filled(part)
        if not surrounded.buffer(NEAR_M).covers(part):
            hull = hull.buffer(WALL_M, join_style="mitre", mitre_limit=MITRE)
        solid += areas(hull.difference(floor))
    return solid


def _filled(polygon: shapely.Polygon) -> shapely.Polygon:
    return shapely.Polygon(polygon.exterior)
