"""Random furnishing of rooms: pillars, cupboards, free-standing and projecting walls, and niches."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from .floor_plan import FloorPlan, frame, rectangle

PASSAGE_M = 0.6
"""Smallest gap between two things."""
SHORTEST_M = 0.1
"""Smallest length of a face."""
DOOR_ROOM_M = 0.7
"""Smallest distance from a door."""
IN_WALL_M = 0.04
"""How far things against a wall reach into it; walls are at least 0.1 m thick."""


def furnish(plan: FloorPlan, per_m2: float, chance: np.random.Generator) -> shapely.Polygon:
    """Return the floor of a plan less what stands on it and with its niches, one piece without narrow gaps."""
    floor = plan.floor
    kept_clear = shapely.union_all([door.buffer(DOOR_ROOM_M) for door in plan.doors])
    areas = np.array([room.area for room in plan.rooms])
    for room in plan.rooms:
        if frame(room)[3] > 6.0 and chance.uniform() < 0.5:
            for pillar in _pillars(room, chance):
                floor = _placed(floor, pillar, kept_clear)
    for _ in range(chance.poisson(per_m2 * areas.sum())):
        room = plan.rooms[int(chance.choice(len(areas), p=areas / areas.sum()))]
        kind = KINDS[int(chance.integers(len(KINDS)))]
        floor = _placed(floor, kind(room, chance), kept_clear)
        if chance.uniform() < 0.4:
            floor = _with_niche(floor, room, plan.wall_m, chance)
    return floor


def _placed(floor: shapely.Polygon, block: shapely.Polygon, kept_clear: BaseGeometry) -> shapely.Polygon:
    """Return the floor without the block, or as it was where the block does not fit."""
    if block.intersects(kept_clear):
        return floor
    return _if_sound(floor.difference(block), floor)


def _if_sound(changed: BaseGeometry, floor: shapely.Polygon) -> shapely.Polygon:
    """Return the changed floor if it is one piece without slivers of wall and new narrow gaps, else the floor."""
    changed = changed.simplify(1e-6)
    if not isinstance(changed, shapely.Polygon) or not changed.is_valid:
        return floor
    if min(_shortest_m(ring) for ring in (changed.exterior, *changed.interiors)) < SHORTEST_M:
        return floor
    return changed if _narrow_m2(changed) < _narrow_m2(floor) + 1e-4 else floor


def _narrow_m2(floor: shapely.Polygon) -> float:
    """Return the area that a disc of passage width does not cover, or infinity if it cannot reach everything."""
    inner = floor.buffer(-0.495 * PASSAGE_M, quad_segs=16)
    # Mitres may cross each other, which buffer(0) repairs.
    grown = inner.buffer(0.505 * PASSAGE_M, join_style="mitre", mitre_limit=10.0).buffer(0)
    return float(floor.area - grown.intersection(floor).area) if isinstance(inner, shapely.Polygon) else np.inf


def _shortest_m(ring: shapely.LinearRing) -> float:
    return float(np.hypot(*np.diff(shapely.get_coordinates(ring), axis=0).T).min())


def _with_niche(
    floor: shapely.Polygon, room: shapely.Polygon, wall_m: float, chance: np.random.Generator
) -> shapely.Polygon:
    """Return the floor with a niche in a wall of the room, where what is behind it is solid enough."""
    place = _place_on_wall(room, chance)
    breadth, depth = chance.uniform(0.65, 1.6), chance.uniform(0.25, 0.8)
    niche = place.block(breadth, -0.01, depth)
    hollow = place.block(breadth + 2.0 * wall_m, 0.001, depth + wall_m).intersects(floor)
    return floor if hollow else _if_sound(floor.union(niche), floor)


@dataclass(frozen=True, eq=False)
class _Place:
    """A place on a wall: where, along the wall, and into it."""

    at: Float[np.ndarray, "2"]
    along: Float[np.ndarray, "2"]
    into: Float[np.ndarray, "2"]
    to_corner_m: float
    """Distance to the nearer end of the wall."""

    def block(self, breadth_m: float, from_m: float, to_m: float) -> shapely.Polygon:
        """Return a rectangle across the wall's face, from and to these distances into the wall."""
        return rectangle(self.at + 0.5 * (from_m + to_m) * self.into, self.along, breadth_m, to_m - from_m)


def _place_on_wall(room: shapely.Polygon, chance: np.random.Generator) -> _Place:
    ring = shapely.get_coordinates(orient(room).exterior)
    sides = np.diff(ring, axis=0)
    lengths = np.hypot(*sides.T)
    k = int(chance.choice(len(sides), p=lengths / lengths.sum()))
    along = sides[k] / lengths[k]
    way = float(chance.uniform(0.0, lengths[k]))
    return _Place(ring[k] + way * along, along, np.array([along[1], -along[0]]), min(way, float(lengths[k]) - way))


def _cupboard(room: shapely.Polygon, chance: np.random.Generator) -> shapely.Polygon:
    """Return a block against a wall, in a corner where one is near."""
    place = _place_on_wall(room, chance)
    breadth = chance.uniform(0.5, 2.0)
    if 0.5 * breadth < place.to_corner_m < 0.5 * breadth + PASSAGE_M:
        breadth = 2.0 * place.to_corner_m + 2.0 * IN_WALL_M
    return place.block(breadth, -chance.uniform(0.3, 0.7), IN_WALL_M)


def _jutting_wall(room: shapely.Polygon, chance: np.random.Generator) -> shapely.Polygon:
    """Return a wall with a free end."""
    return _place_on_wall(room, chance).block(chance.uniform(0.1, 0.25), -chance.uniform(0.4, 2.0), IN_WALL_M)


def _standing_wall(room: shapely.Polygon, chance: np.random.Generator) -> shapely.Polygon:
    """Return a wall that stands free, at any angle."""
    return rectangle(_inside(room, chance), _direction(chance), chance.uniform(0.8, 3.0), chance.uniform(0.1, 0.3))


def _standing_block(room: shapely.Polygon, chance: np.random.Generator) -> shapely.Polygon:
    """Return a block or a polygonal column that stands free."""
    at, along = _inside(room, chance), _direction(chance)
    if chance.uniform() < 0.5:
        along = frame(room)[1]
    if chance.uniform() < 0.6:
        return rectangle(at, along, chance.uniform(0.4, 2.0), chance.uniform(0.3, 1.0))
    corners = int(chance.integers(3, 7))
    radius = chance.uniform(0.35, 0.7)
    angles = np.arctan2(along[1], along[0]) + 2.0 * np.pi * np.arange(corners) / corners
    return shapely.Polygon(at + radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1))


def _pillars(room: shapely.Polygon, chance: np.random.Generator) -> Iterator[shapely.Polygon]:
    """Return rows of equal pillars across a large room."""
    middle, along, long_m, short_m = frame(room)
    across = np.array([-along[1], along[0]])
    pitch, side = chance.uniform(2.5, 4.0), chance.uniform(0.3, 0.7)
    columns, rows = max(int(long_m / pitch) - 1, 1), max(int(short_m / pitch) - 1, 1)
    for i in range(columns):
        for j in range(rows):
            shift = (i - 0.5 * (columns - 1)) * pitch * along + (j - 0.5 * (rows - 1)) * pitch * across
            yield rectangle(middle + shift, along, side, side)


def _inside(room: shapely.Polygon, chance: np.random.Generator) -> Float[np.ndarray, "2"]:
    """Return a place somewhere in a convex room."""
    ring = shapely.get_coordinates(room.exterior)[:-1]
    return chance.dirichlet(np.ones(len(ring))) @ ring


def _direction(chance: np.random.Generator) -> Float[np.ndarray, "2"]:
    angle = chance.uniform(0.0, 2.0 * np.pi)
    return np.array([np.cos(angle), np.sin(angle)])


KINDS: tuple[Callable[[shapely.Polygon, np.random.Generator], shapely.Polygon], ...] = (
    _cupboard, _cupboard, _jutting_wall, _standing_wall, _standing_block,
)  # fmt: skip
