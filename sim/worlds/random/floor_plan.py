"""Random rooms and doors: an outline is cut into convex rooms, some along slanted lines, and doors join them."""

from dataclasses import dataclass

import networkx as nx
import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry
from shapely.ops import split

JAMB_M = 0.1
"""Smallest length of wall between a door and the next corner."""


@dataclass(frozen=True)
class Style:
    """Parameters of a kind of building: lengths in m, each as a range."""

    name: str
    long_m: tuple[float, float]
    """Longer side of the outline."""
    short_m: tuple[float, float]
    """Shorter side of the outline."""
    room_m: tuple[float, float]
    """A room is not cut further if its longer side is below a draw from this range."""
    corridor: float
    """Probability that the outline is cut into two wings along a corridor first."""
    slanted: float
    """Probability that a cut is slanted."""
    solid: float
    """Probability that a room is left out of the building: outlines become L, U or ring shapes."""
    second_door: float
    """Probability of a door between two neighbouring rooms that are connected already."""
    furniture: float
    """Mean number of blocks per square metre."""


STYLES = (
    Style("apartment", (7.0, 13.0), (6.0, 9.0), (3.5, 5.5), 0.3, 0.15, 0.12, 0.3, 0.16),
    Style("office", (12.0, 20.0), (8.0, 11.0), (4.0, 6.0), 1.0, 0.1, 0.08, 0.15, 0.06),
    Style("hall", (9.0, 17.0), (8.5, 14.0), (11.0, 20.0), 0.0, 0.25, 0.0, 0.5, 0.1),
    Style("crooked", (8.0, 15.0), (7.0, 11.0), (4.5, 7.0), 0.3, 0.8, 0.15, 0.3, 0.1),
)

NARROWEST_ROOM_M = 1.9
CORRIDOR_M = (1.2, 2.2)
DOOR_M = (0.6, 1.6)


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """Convex rooms with walls between them, and doors through the walls; m, world frame."""

    rooms: tuple[shapely.Polygon, ...]
    """The floor of each room, up to its walls."""
    doors: tuple[shapely.Polygon, ...]
    """A rectangle through the wall for each door."""
    wall_m: float
    """Thickness of the walls between rooms."""

    @property
    def floor(self) -> shapely.Polygon:
        """Rooms and doors in one."""
        whole = shapely.union_all([*self.rooms, *self.doors])
        assert isinstance(whole, shapely.Polygon)
        return whole


def floor_plan(style: Style, chance: np.random.Generator) -> FloorPlan:
    """Return a plan whose rooms are all joined by doors."""
    width, height = chance.uniform(*style.long_m), chance.uniform(*style.short_m)
    wall_m = chance.uniform(0.1, 0.3)
    cells = _cells(shapely.box(0.0, 0.0, width, height), style, chance)
    borders = _borders(cells, DOOR_M[0] + 2.0 * _aside(wall_m))
    kept = _left_standing(cells, borders, style, chance)
    doors = [
        _door(borders[pair], wall_m, chance)
        for pair in sorted(_doorways(kept, [pair for pair in borders if set(pair) <= set(kept)], style, chance))
    ]
    rooms = [cells[k].buffer(-0.5 * wall_m, join_style="mitre", mitre_limit=10.0) for k in kept]
    return FloorPlan(tuple(rooms), tuple(doors), wall_m)


def _cells(outline: shapely.Polygon, style: Style, chance: np.random.Generator) -> list[shapely.Polygon]:
    """Cut the outline into convex cells, a corridor first where the style has one."""
    if chance.uniform() >= style.corridor:
        return _cut_up(outline, style, chance)
    x0, y0, x1, y1 = outline.bounds
    breadth = chance.uniform(*CORRIDOR_M)
    low = chance.uniform(0.35, 0.65) * (y1 - y0) - 0.5 * breadth
    wings = [shapely.box(x0, y0, x1, y0 + low), shapely.box(x0, y0 + low + breadth, x1, y1)]
    return [
        shapely.box(x0, y0 + low, x1, y0 + low + breadth),
        *(cell for wing in wings for cell in _cut_up(wing, style, chance)),
    ]


def _cut_up(cell: shapely.Polygon, style: Style, chance: np.random.Generator) -> list[shapely.Polygon]:
    """Cut a convex cell across its longer side, and the pieces again, until they are small enough for rooms."""
    middle, along, long_m, _ = frame(cell)
    if long_m < chance.uniform(*style.room_m):
        return [cell]
    for _ in range(8):
        at = middle + chance.uniform(-0.2, 0.2) * long_m * along
        turn = np.deg2rad(chance.uniform(8.0, 28.0)) * chance.choice([-1, 1]) if chance.uniform() < style.slanted else 0
        across = _turned(along, 0.5 * np.pi + turn)
        pieces = _areas(split(cell, shapely.LineString([at - 100.0 * across, at + 100.0 * across])))
        if len(pieces) == 2 and all(_is_room(piece) for piece in pieces):
            return [small for piece in pieces for small in _cut_up(piece, style, chance)]
    return [cell]


def _is_room(piece: shapely.Polygon) -> bool:
    """Return whether a piece is large enough and has neither a wall shorter than a door nor an acute corner."""
    ring = shapely.get_coordinates(piece.exterior)[:-1]
    before, after = np.roll(ring, 1, axis=0) - ring, np.roll(ring, -1, axis=0) - ring
    lengths = np.hypot(*after.T)
    cosine = np.sum(before * after, axis=1) / (np.hypot(*before.T) * lengths)
    roomy = frame(piece)[3] >= NARROWEST_ROOM_M
    return bool(roomy and lengths.min() > 1.2 and cosine.max() < np.cos(np.deg2rad(55.0)))


def _borders(cells: list[shapely.Polygon], least_m: float) -> dict[tuple[int, int], Float[np.ndarray, "2 2"]]:
    """Return the line between each two cells that share one of this length."""
    borders = {}
    # Cuts made one after the other share a line only up to rounding: the overlap of widened cells is robust.
    wide = [cell.buffer(0.01, join_style="mitre") for cell in cells]
    for i in range(len(cells)):
        for j in range(i + 1, len(cells)):
            strip = wide[i].intersection(wide[j])
            if strip.is_empty or strip.area < 0.02 * least_m:
                continue
            middle, along, long_m, _ = frame(strip)
            if long_m >= least_m:
                borders[i, j] = np.array([middle - 0.5 * long_m * along, middle + 0.5 * long_m * along])
    return borders


def _left_standing(
    cells: list[shapely.Polygon],
    borders: dict[tuple[int, int], Float[np.ndarray, "2 2"]],
    style: Style,
    chance: np.random.Generator,
) -> list[int]:
    """Return the cells that become rooms: some are left solid where the others stay connected."""
    graph: nx.Graph[int] = nx.Graph(list(borders))
    graph.add_nodes_from(range(len(cells)))
    kept = sorted(max(nx.connected_components(graph), key=lambda part: sum(cells[k].area for k in part)))
    for k in chance.permutation(kept).tolist():
        rest = [other for other in kept if other != k]
        if chance.uniform() < style.solid and len(rest) > 2 and nx.is_connected(graph.subgraph(rest)):
            kept = rest
    return kept


def _doorways(
    kept: list[int], pairs: list[tuple[int, int]], style: Style, chance: np.random.Generator
) -> list[tuple[int, int]]:
    """Return the pairs of rooms with a door: a random tree, and some more, which make cycles."""
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(kept)
    graph.add_weighted_edges_from((i, j, float(chance.uniform())) for i, j in pairs)
    tree = {(min(pair), max(pair)) for pair in nx.minimum_spanning_edges(graph, data=False)}
    return [pair for pair in pairs if pair in tree or chance.uniform() < style.second_door]


def _door(border: Float[np.ndarray, "2 2"], wall_m: float, chance: np.random.Generator) -> shapely.Polygon:
    """Return a rectangle through the wall along a border, with a jamb on either side."""
    length = float(np.hypot(*(border[1] - border[0])))
    along = (border[1] - border[0]) / length
    aside = _aside(wall_m)
    width = chance.uniform(DOOR_M[0], min(DOOR_M[1], length - 2.0 * aside))
    at = chance.uniform(aside + 0.5 * width, length - aside - 0.5 * width)
    return rectangle(border[0] + at * along, along, width, wall_m + 0.02)


def _aside(wall_m: float) -> float:
    """Return the distance of a door from a border's end: in a corner of 55 degrees walls take their own thickness."""
    return wall_m + JAMB_M


def frame(shape: BaseGeometry) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"], float, float]:
    """Return middle, direction of the longer side, and both sides m of the smallest rectangle around a shape."""
    ring = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape))
    sides = np.diff(ring[:3], axis=0)
    lengths = np.hypot(*sides.T)
    longer = int(np.argmax(lengths))
    return ring[:4].mean(axis=0), sides[longer] / lengths[longer], float(lengths.max()), float(lengths.min())


def rectangle(
    middle: Float[np.ndarray, "2"], along: Float[np.ndarray, "2"], length_m: float, breadth_m: float
) -> shapely.Polygon:
    """Return a rectangle around a middle, its length in the direction of the unit vector `along`."""
    a, b = 0.5 * length_m * along, 0.5 * breadth_m * _turned(along, 0.5 * np.pi)
    return shapely.Polygon([middle - a - b, middle + a - b, middle + a + b, middle - a + b])


def _turned(vector: Float[np.ndarray, "2"], angle_rad: float) -> Float[np.ndarray, "2"]:
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _areas(shape: shapely.GeometryCollection) -> list[shapely.Polygon]:
    return [part for part in shape.geoms if isinstance(part, shapely.Polygon)]
