"""From a drawing to a world: lines become thick walls, slits are closed, the free space around the start is kept."""

import numpy as np
import shapely
from jaxtyping import Float
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from .drawing import Drawing, WorldError
from .limits import check_apart, check_extent
from .rooms import WALL_M, areas
from .text import name_of
from .world import ROBOT_RADIUS_M, Reading, World

SLIT_M = 0.06
"""Narrower free gaps are artefacts of the drawing: no beam should pass."""
MITRE = 10.0
OUTSIDE_RATIO = 8.0
"""A picture's margin is outside, unless it is this much larger than everything that the drawing encloses."""


def build(name: str, drawing: Drawing, start: Float[np.ndarray, "3"] | None = None) -> World:
    """Return the world of a drawing, `start` replacing its own; raise WorldError if no robot could drive in it."""
    solid = _with_doors(solid_of(drawing), drawing.openings)
    check_extent(np.reshape(solid.bounds, (2, 2)))
    enclosed, open_parts = _free_parts(solid, drawing.sheet)
    wanted = start if start is not None else drawing.start
    if wanted is None:
        part, pose = _choose(enclosed, open_parts)
        said = "assumed, where a robot has most room (--start X Y says another)"
    else:
        part, pose = _part_with(wanted, solid, enclosed + open_parts), wanted
        said = "given" if start is not None else "as the file says"
    free = orient(_straighten(part, drawing.simplify_m), 1.0)
    _check_clearance(free, pose)
    reading = Reading(drawing.understood, drawing.scale, said, drawing.notes)
    return World(name_of(name), free, pose, dict(drawing.labels), reading)


def solid_of(drawing: Drawing) -> BaseGeometry:
    """Return everything solid: walls 0.1 m thick around the lines, and filled polygons, repaired where they cross."""
    if not drawing.lines and not drawing.solids:
        raise WorldError("expected walls, found none: draw dark lines or filled shapes")
    lines, solids = _on_grid(drawing.lines), _on_grid(drawing.solids)
    merged = shapely.line_merge(shapely.union_all(lines)) if len(lines) else shapely.LineString()
    check_apart([merged], WALL_M)
    thick = merged.buffer(0.5 * WALL_M, cap_style="square", join_style="mitre", mitre_limit=MITRE)
    mended = [shapely.make_valid(polygon) for polygon in solids]
    return shapely.union_all([thick, *(part for shape in mended for part in areas(shape))])


def _with_doors(solid: BaseGeometry, openings: tuple[shapely.Polygon, ...]) -> BaseGeometry:
    """Return what is solid once the doors are open, except for those through which a robot could leave the building."""
    if not openings:
        return solid
    page = shapely.box(*solid.bounds).buffer(1.0, join_style="mitre")
    roomy = [piece for part in areas(page.difference(solid)) for piece in _opened(part, 2 * ROBOT_RADIUS_M)]
    outside = shapely.union_all([piece for piece in roomy if shapely.distance(piece, page.exterior) < 1e-6])
    inner = [opening for opening in openings if outside.intersection(opening).area < 1e-6]
    return solid.difference(shapely.union_all(inner))


def _on_grid(shapes: tuple[shapely.LineString, ...] | tuple[shapely.Polygon, ...]) -> NDArray[np.object_]:
    """Return shapes on a grid of 1 micrometre, without those that vanish: smaller steps break polygon operations."""
    rounded: NDArray[np.object_] = shapely.transform(np.array(shapes, dtype=object), lambda at: np.round(at, 6))
    return rounded[shapely.length(rounded) > 0]


def _free_parts(
    solid: BaseGeometry, sheet: shapely.Polygon | None
) -> tuple[list[shapely.Polygon], list[shapely.Polygon]]:
    """Return the free parts that walls enclose, and those that end at the border of a picture."""
    page = sheet if sheet is not None else shapely.box(*solid.bounds).buffer(1.0, join_style="mitre")
    # Slits are closed first: walls that almost touch keep the outside out.
    free = areas(page.difference(solid))
    check_apart(free, 0.5 * SLIT_M)
    parts = [piece for part in free for piece in _opened(part, SLIT_M)]
    touching = shapely.distance(np.array(parts, dtype=object), page.exterior) < 1e-6
    enclosed = [part for part, out in zip(parts, touching, strict=True) if not out]
    outer = [part for part, out in zip(parts, touching, strict=True) if out]
    if sheet is not None:
        return enclosed, outer
    return enclosed + [piece for part in outer for piece in _behind_leaks(part, page)], []


def _behind_leaks(part: shapely.Polygon, page: shapely.Polygon) -> list[shapely.Polygon]:
    """Return what is cut off from the outside once gaps of the outer wall that no robot can pass are closed."""
    roomy = _opened(part, 2 * ROBOT_RADIUS_M)
    outside = [piece for piece in roomy if shapely.distance(piece, page.exterior) < 1e-6]
    if len(outside) == len(roomy):
        return []
    rest = part.difference(shapely.union_all(outside))
    return [piece for inner in areas(rest) for piece in _opened(inner, SLIT_M)]


def _opened(part: shapely.Polygon, width_m: float) -> list[shapely.Polygon]:
    """Return the pieces of a free part without what is narrower, all other corners where they were drawn."""
    pieces = areas(part.buffer(-0.5 * width_m, quad_segs=8))
    # Grown with mitres, a little more than what arcs of 8 chords lost, and clipped: corners come back exactly. One by
    # one, lest the mitres of two pieces meet again in the slit between them.
    grown = [piece.buffer(0.505 * width_m, join_style="mitre", mitre_limit=MITRE) for piece in pieces]
    # Among many acute corners the mitres of one piece cross each other at times.
    whole = [piece if piece.is_valid else shapely.make_valid(piece) for piece in grown]
    return [area for piece in whole for area in areas(piece.intersection(part))]


def _choose(
    enclosed: list[shapely.Polygon], open_parts: list[shapely.Polygon]
) -> tuple[shapely.Polygon, Float[np.ndarray, "3"]]:
    """Return the part with the most room for a robot, and its position farthest from all walls."""
    (inside_m2, inside), (outside_m2, outside) = (_roomiest(parts) for parts in (enclosed, open_parts))
    drivable_m2, part = (inside_m2, inside) if OUTSIDE_RATIO * inside_m2 >= outside_m2 else (outside_m2, outside)
    if drivable_m2 == 0:
        raise WorldError(
            "expected a free space that walls enclose and that a robot of 0.2 m radius fits into, found none:"
            " draw a closed wall around the building, or correct the scale (--scale METRES)"
        )
    middle = shapely.get_coordinates(shapely.maximum_inscribed_circle(part, tolerance=0.02))[0]
    return part, np.array([round(middle[0], 3), round(middle[1], 3), 0.0])


def _roomiest(parts: list[shapely.Polygon]) -> tuple[float, shapely.Polygon]:
    """Return the part with most room to drive in, and how much that is, m2."""
    # What is smaller than the most room found so far need not be measured: there may be thousands of chambers.
    best, room_m2 = shapely.Polygon(), 0.0
    for part in parts:
        if part.area > room_m2 and (drivable_m2 := _drivable(part)) > room_m2:
            best, room_m2 = part, drivable_m2
    return room_m2, best


def _drivable(part: shapely.Polygon) -> float:
    """Return the area m2 of the largest piece that the robot's centre can reach."""
    return max((piece.area for piece in areas(part.buffer(-ROBOT_RADIUS_M))), default=0.0)


def _part_with(start: Float[np.ndarray, "3"], solid: BaseGeometry, parts: list[shapely.Polygon]) -> shapely.Polygon:
    at = shapely.Point(start[:2])
    for part in parts:
        if part.contains(at):
            return part
    if solid.distance(at) < ROBOT_RADIUS_M:
        found = "inside a wall" if solid.contains(at) else "too near a wall"
    else:
        found = "outside the area that walls enclose"
    raise WorldError(
        f"expected a start in the free space, found ({start[0]:.6g}, {start[1]:.6g}) {found}:"
        " move the start, or close the outer wall around it"
    )


def _check_clearance(free: shapely.Polygon, start: Float[np.ndarray, "3"]) -> None:
    at = shapely.Point(start[:2])
    clearance = shapely.distance(free.boundary, at) if free.contains(at) else 0.0
    if clearance < ROBOT_RADIUS_M:
        raise WorldError(
            f"expected a start {ROBOT_RADIUS_M} m or more from all walls, found {clearance:.3f} m at"
            f" ({start[0]:.6g}, {start[1]:.6g}): move the start"
        )


def _straighten(part: shapely.Polygon, tolerance_m: float) -> shapely.Polygon:
    """Return a free part whose faces are straight: each ring simplified, and no vertex left on a straight wall."""
    simple = part.simplify(tolerance_m)
    if not isinstance(simple, shapely.Polygon) or not simple.is_valid or simple.is_empty:
        simple = part
    rings = [drop_collinear(shapely.get_coordinates(ring)[:-1]) for ring in (simple.exterior, *simple.interiors)]
    straight = shapely.Polygon(rings[0], [ring for ring in rings[1:] if len(ring) > 2])
    return straight if straight.is_valid else simple


def drop_collinear(ring: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """Return a ring without vertices that lie within 1 micrometre of the chord of their neighbours."""
    before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
    chord, off = after - before, ring - before
    length = np.maximum(np.hypot(chord[:, 0], chord[:, 1]), 1e-12)
    kept: Float[np.ndarray, "m 2"] = ring[np.abs(chord[:, 0] * off[:, 1] - chord[:, 1] * off[:, 0]) > 1e-6 * length]
    return kept
