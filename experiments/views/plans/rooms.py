"""Rooms: what walls surround, once the gaps in them are closed by straight lines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
import shapely.ops
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry

from chainslam.slam.map.chains import HEAD, TAIL

from ...scoring.maps.measurements import perimeter
from .faces import Faces, Node
from .measuring import Dimension, Kind, are_firm, area_of, walls_of
from .openings import Gap

LEAST_M2 = 1.0
"""Smaller spaces, such as that between the two sides of a doorway, are no rooms."""
INSIDE = 0.9
"""Share of a room's walls that look into it."""
GRID_M = 1e-6
CLEAR_M = 0.02
"""A line that closes a gap touches other walls at most so near to its ends."""


@dataclass(frozen=True)
class Room:
    """A room with its measurements."""

    area: Dimension
    perimeter: Dimension
    outline_world: Float[np.ndarray, "k 2"]
    holes_world: tuple[Float[np.ndarray, "_ 2"], ...]
    openings: int
    """How many openings it is closed over."""
    unseen: int
    """How many gaps besides, where the wall may go on."""


def rooms(faces: Faces, gaps: Sequence[Gap], without: set[int]) -> list[Room]:
    """Return the rooms, the largest first; walls in the rows `without` bound none."""
    edges, facing = _edges(faces, without)
    walls = [_line(faces, edge) for edge in edges]
    closing = _clear(faces, gaps, shapely.union_all(walls))
    lines = [*walls, *(_line(faces, edge) for edge in closing)]
    lines = [line for line in lines if line.length > GRID_M]
    if not lines:
        return []
    noded = shapely.union_all(shapely.set_precision(np.array(lines, dtype=object), GRID_M))
    named = _named(faces, [node for edge in (*edges, *closing) for node in edge])
    found = []
    for part in shapely.get_parts(shapely.polygonize([noded])):
        if part.area >= LEAST_M2 and _is_inside(part, faces, facing):
            rings = [_nodes(ring, named) for ring in (part.exterior, *part.interiors)]
            if all(ring is not None for ring in rings):
                found.append(_room(faces, part, [ring for ring in rings if ring is not None], gaps))
    return sorted(found, key=lambda room: -room.area.measured.value)


def _edges(faces: Faces, without: set[int]) -> tuple[list[tuple[Node, Node]], list[int]]:
    """Return the walls between their nodes, and what joins neighbours without a corner; and the rows of the walls."""
    rows = [wall for chain in faces.chains for wall in chain if wall not in without]
    walls = [(faces.node(wall, TAIL), faces.node(wall, HEAD)) for wall in rows]
    joints = [
        (faces.node(before, HEAD), faces.node(after, TAIL)) for before, after in faces.neighbours
        if not {before, after} & without and (before, HEAD) not in faces.corners
    ]  # fmt: skip
    return [*walls, *joints], rows


def _clear(faces: Faces, gaps: Sequence[Gap], walls: BaseGeometry) -> list[tuple[Node, Node]]:
    """Return the lines that close gaps, without those that cross a wall or a narrower gap."""
    kept: list[tuple[Node, Node]] = []
    taken = walls
    for gap in gaps:
        line = _line(faces, (gap.first, gap.second))
        inner = shapely.ops.substring(line, CLEAR_M, line.length - CLEAR_M)
        if not inner.intersects(taken):
            kept.append((gap.first, gap.second))
            taken = shapely.union(taken, line)
    return kept


def _line(faces: Faces, edge: tuple[Node, Node]) -> shapely.LineString:
    return shapely.LineString([faces.place(edge[0]), faces.place(edge[1])])


def _named(faces: Faces, nodes: Sequence[Node]) -> dict[tuple[int, int], Node]:
    return {_key(faces.place(node)): node for node in nodes}


def _key(at: Float[np.ndarray, "2"]) -> tuple[int, int]:
    x, y = np.round(at / GRID_M).astype(int).tolist()
    return x, y


def _nodes(ring: shapely.LinearRing, named: dict[tuple[int, int], Node]) -> tuple[Node, ...] | None:
    """Return the nodes of a ring; None if lines cross where no corner is known."""
    found = []
    for x, y in map(_key, shapely.get_coordinates(ring)[:-1]):
        node = next((named[near] for near in _around(x, y) if near in named), None)
        if node is None:
            return None
        found.append(node)
    return tuple(found)


def _around(x: int, y: int) -> list[tuple[int, int]]:
    return [(x + i, y + j) for i in (0, -1, 1) for j in (0, -1, 1)]


def _is_inside(part: shapely.Polygon, faces: Faces, rows: Sequence[int]) -> bool:
    """Return whether the walls on the outline of a part look into it: their free side is on the left."""
    ends = faces.ends_world[list(rows)]
    middles = ends.mean(axis=1)
    lengths = faces.lengths_m[list(rows)]
    along = (ends[:, 1] - ends[:, 0]) / np.maximum(lengths, 1e-9)[:, None]
    left = middles + 2e-3 * np.stack([-along[:, 1], along[:, 0]], axis=-1)
    on = shapely.distance(shapely.points(middles), part.boundary) < 1e-4
    into = on & shapely.contains_xy(part, *left.T)
    return bool(lengths[into].sum() >= INSIDE * max(float(lengths[on].sum()), 1e-9))


def _room(faces: Faces, part: shapely.Polygon, rings: Sequence[tuple[Node, ...]], gaps: Sequence[Gap]) -> Room:
    label = shapely.get_coordinates(shapely.maximum_inscribed_circle(part, tolerance=0.05))[0]
    nodes = [node for ring in rings for node in ring]
    on = [gap for gap in gaps if gap.first in nodes and gap.second in nodes]
    ends = np.array([label, label])
    walls, firm = walls_of(nodes), are_firm(nodes)
    size = Dimension(Kind.AREA, label, ends, area_of(faces, rings), walls, tuple(rings), is_firm=firm)
    around = perimeter(faces.points(rings[0]), range(len(rings[0])))
    length = Dimension(Kind.PERIMETER, label, ends, around, walls, (rings[0],), is_firm=firm)
    holes = tuple(shapely.get_coordinates(ring)[:-1] for ring in part.interiors)
    outline = shapely.get_coordinates(part.exterior)[:-1]
    return Room(size, length, outline, holes, sum(gap.is_seen for gap in on), sum(not gap.is_seen for gap in on))
