"""Lengths of walls and areas of rooms with their 95 % intervals, for the floor plan."""

import numpy as np
import shapely

from chainslam.viz.floor_plan import Dimension

from ...scoring.maps.measurements import Measured
from .mapped import MappedCorners, Room


def dimensions(mapped: MappedCorners) -> list[Dimension]:
    """Return the sides of all closed chains whose two corners are sharp, and the areas of the rooms among them."""
    islands = [_polygon(mapped, room) for room in mapped.rooms if room.is_island]
    sides = [side for room in mapped.rooms for side in _sides(mapped, room)]
    areas = [_area(mapped, room, islands) for room in mapped.rooms if not room.is_island]
    return [*sides, *(area for area in areas if area is not None)]


def _sides(mapped: MappedCorners, room: Room) -> list[Dimension]:
    found = []
    for first, second, measured in mapped.sides(room):
        if not (mapped.sharp[first] and mapped.sharp[second]):
            continue
        start, end = mapped.points.positions_world[[first, second]]
        hint = f"corner {first} to corner {second}: {_interval(measured, 'm')}"
        found.append(Dimension((start + end) / 2, end - start, _words(measured, "m"), hint))
    return found


def _area(mapped: MappedCorners, room: Room, islands: list[shapely.Geometry]) -> Dimension | None:
    floor = shapely.difference(_polygon(mapped, room), shapely.union_all(islands))
    if not isinstance(floor, shapely.Polygon | shapely.MultiPolygon) or floor.is_empty:
        return None
    if not all(mapped.sharp[corner] for corner in room.corners):
        return None
    radius = shapely.maximum_inscribed_circle(floor, tolerance=0.05)
    if radius is None:
        return None
    middle, width = shapely.get_coordinates(radius)[0], 2.0 * shapely.length(radius)
    measured = mapped.area(room)
    hint = f"inside the walls of chain {room.chain}: {_interval(measured, 'm²')}"
    return Dimension(middle, np.array([width, 0.0]), _words(measured, "m²"), hint, is_area=True)


def _polygon(mapped: MappedCorners, room: Room) -> shapely.Geometry:
    if len(room.corners) < 3:  # the two faces of one thin object, seen from all sides
        return shapely.Polygon()
    return shapely.make_valid(shapely.Polygon(mapped.points.positions_world[list(room.corners)]))


def _words(measured: Measured, unit: str) -> str:
    half = measured.interval[1] - measured.value
    return f"{measured.value:.3f} ± {half:.3f}" + (f" {unit}" if unit != "m" else "")


def _interval(measured: Measured, unit: str) -> str:
    low, high = measured.interval
    return f"{measured.value:.3f} {unit}, 95 % interval {low:.3f} to {high:.3f} {unit}"
