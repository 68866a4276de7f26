"""GeoJSON: LineStrings are walls, Polygons are rooms or solid, named Points are the start and labels.

A Point whose id, or property `id`, `name` or `kind`, is `start` marks the start (optional property `heading` in rad);
any other named Point is a label. The kind of a feature is a property (`kind`, `type`, `indoor`, ...: `room`, `solid`,
`door`, `level`, ...); without one, the shape of a Polygon decides (see `rooms`). Doors may be lines, points or
polygons: solid parts there are removed, unless that would open the building to its outside. Of several storeys one is
read. A map written by chainslam can be read as a world: its closed chains are rooms and islands, its open chains
walls.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float

from ...drawing import Drawing, WorldError, counted, shorten
from ...limits import check_count, check_labels, check_size
from ...options import AS_DRAWN, DrawingOptions
from ...rooms import WALL_M, Outline, areas, plan_of
from .doors import at_point, opening, shared_walls
from .features import About, features, listed, position, positions
from .plane import Laid, Plane, laid
from .words import first_level, level_name

Said = list[tuple[dict[str, Any], About]]


@dataclass
class _Found:
    """What has been read so far, m."""

    lines: list[shapely.LineString] = field(default_factory=list)
    outlines: list[Outline] = field(default_factory=list)
    shells: list[shapely.Polygon] = field(default_factory=list)
    """Borders of storeys and buildings."""
    walled: list[shapely.Polygon] = field(default_factory=list)
    """Rooms whose tool draws a wall where two of them touch."""
    rooms: list[shapely.Polygon] = field(default_factory=list)
    doors: list[shapely.LineString] = field(default_factory=list)
    door_points: list[tuple[Float[np.ndarray, "2"], float | None]] = field(default_factory=list)
    leaves: list[shapely.Polygon] = field(default_factory=list)
    """Doors drawn as polygons."""
    points: dict[str, Float[np.ndarray, "3"]] = field(default_factory=dict)
    left_out: int = 0


def from_geojson(document: dict[str, Any], options: DrawingOptions = AS_DRAWN) -> Drawing:
    """Return the drawing of a parsed GeoJSON object; raise WorldError where it is no GeoJSON of a building."""
    options.check_only(("scale", "level"), "GeoJSON")
    said, storey = _on_level(features(document), options.level)
    where = laid(document, _bounds(said), options.scale)
    found = _Found()
    for geometry, about in said:
        _add(found, geometry, about, where.plane)
    return _drawing(found, where, storey)


def _drawing(found: _Found, where: Laid, storey: str) -> Drawing:
    outlines = found.outlines
    if not any(outline.kind == "room" for outline in outlines) and not found.lines:
        outlines = outlines + [Outline(shell, "room") for shell in found.shells]
    polygons = [outline.polygon for outline in outlines]
    check_size(found.lines, polygons)
    start = found.points.pop("start", None)
    check_labels(found.points)
    rooms = found.rooms if found.doors or found.door_points else found.walled
    lines = [*found.lines, *shared_walls(rooms)]
    plan = plan_of(outlines, lines)
    openings, doors = _openings(found, lines)
    guessed = any(outline.kind is None for outline in outlines)
    # A door drawn as a polygon is free floor, as a room is; it is counted as a door.
    words = [
        counted(plan.rooms - len(found.leaves), "polygon as a room", "polygons as rooms"),
        counted(len(polygons) - plan.rooms, "polygon as solid", "polygons as solid"),
        counted(len(found.lines), "line as a wall", "lines as walls"),
        counted(len(lines) - len(found.lines), "edge that rooms share as a wall", "edges that rooms share as walls"),
        counted(doors, "door", "doors"),
    ]
    text = ", ".join(word for word in words if word)
    text += " (by their shape; a property kind of room or solid says it)" if guessed else ""
    shells = len(found.shells) if outlines is found.outlines else 0
    notes = [
        *([storey] if storey else []),
        *([f"left out: {counted(shells, 'outline', 'outlines')} of a storey or a building"] if shells else []),
        *_left_out(found),
        *_lost(found, doors),
    ]  # fmt: skip
    labels = {name: (float(at[0]), float(at[1])) for name, at in found.points.items()}
    return Drawing(
        tuple(lines), plan.solids, start, labels, openings=tuple(openings), understood=text, scale=where.words,
        notes=tuple(notes),
    )  # fmt: skip


def _left_out(found: _Found) -> list[str]:
    count = counted(found.left_out, "feature", "features")
    return [f"left out: {count} of kinds that are no walls"] if count else []


def _lost(found: _Found, doors: int) -> list[str]:
    lost = len(found.doors) + len(found.door_points) + len(found.leaves) - doors
    return [f"left out: {counted(lost, 'door', 'doors')} with no wall near"] if lost else []


def _openings(found: _Found, lines: Sequence[shapely.LineString]) -> tuple[list[shapely.Polygon], int]:
    """Return what the doors open, and how many of them have a wall."""
    walls = list(lines) + [shapely.LineString(room.exterior) for room in found.rooms]
    drawn = [at_point(place, width, walls) for place, width in found.door_points]
    doors = [*found.doors, *(line for line in drawn if line is not None)]
    return [*(part for door in doors for part in opening(door)), *found.leaves], len(doors) + len(found.leaves)


def _on_level(said: Said, wanted: str | None) -> tuple[Said, str]:
    """Return the features of one storey and those of none, and in words which; raises WorldError for no such."""
    levels = sorted({level for _, about in said for level in about.levels})
    if wanted is None:
        if len(levels) < 2:
            return said, ""
        chosen = first_level(levels)
        words = f"storey {shorten(chosen)} of {', '.join(map(shorten, levels[:12]))} (--level names another)"
    else:
        chosen, words = level_name(wanted), ""
        if chosen not in levels:
            there = ", ".join(map(shorten, levels[:12])) or "none"
            raise WorldError(f"expected --level of the file ({there}), found {shorten(wanted)}: choose one of these")
    return [(geometry, about) for geometry, about in said if not about.levels or chosen in about.levels], words


def _bounds(said: Said) -> tuple[float, float, float, float]:
    """Return the box around all walls and rooms, as they stand in the file; raises WorldError for broken geometry."""
    paths = [path for geometry, about in said for path in _paths(geometry, about)]
    if not paths:
        return 0.0, 0.0, 0.0, 0.0
    points = np.concatenate(paths)
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def _paths(geometry: dict[str, Any], about: About) -> list[Float[np.ndarray, "_ 2"]]:
    """Return the lines and rings of a geometry."""
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind in ("LineString", "MultiLineString"):
        lines = [coordinates] if kind == "LineString" else listed(coordinates, kind)
        return [positions(line, 2) for line in lines]
    if kind in ("Polygon", "MultiPolygon"):
        if about.unknown:
            raise WorldError(
                f"expected a polygon of kind room or solid, found {about.unknown}: use such a word, or leave kind out"
            )
        polygons = [coordinates] if kind == "Polygon" else listed(coordinates, kind)
        return [positions(ring, 4) for rings in polygons for ring in listed(rings, kind)]
    if kind not in ("Point", "MultiPoint"):
        raise WorldError(f"expected a GeoJSON geometry, found type {shorten(kind)}: correct the file")
    return []


def _add(found: _Found, geometry: dict[str, Any], about: About, plane: Plane) -> None:
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if about.kind == "nothing":
        found.left_out += 1
    elif kind == "Point":
        _add_point(found, plane(position(coordinates)[None])[0], about)
    elif kind in ("LineString", "MultiLineString"):
        for path in _paths(geometry, about):
            if np.ptp(path, axis=0).any():
                _add_line(found, shapely.LineString(plane(path)), about)
    elif kind in ("Polygon", "MultiPolygon"):
        for rings in [coordinates] if kind == "Polygon" else listed(coordinates, "MultiPolygon"):
            paths = [plane(positions(ring, 4)) for ring in listed(rings, "Polygon")]
            if paths:
                _add_polygon(found, shapely.Polygon(paths[0], paths[1:]), about)


def _add_point(found: _Found, at: Float[np.ndarray, "2"], about: About) -> None:
    if about.kind == "door":
        found.door_points.append((at, about.width))
    elif about.name is not None:
        found.points[about.name] = np.array([at[0], at[1], about.heading])
    else:
        found.left_out += 1


def _add_line(found: _Found, line: shapely.LineString, about: About) -> None:
    if about.is_own:
        # An open chain is the face of a wall: the free side is on its left, and all of the wall on its right.
        band = shapely.make_valid(line.buffer(-WALL_M, single_sided=True, join_style="mitre"))
        found.outlines += [Outline(part, "solid") for part in areas(band)]
    elif about.kind == "door":
        found.doors.append(line)
    elif about.kind == "outline":
        found.left_out += 1
    else:
        found.lines.append(line)


def _add_polygon(found: _Found, polygon: shapely.Polygon, about: About) -> None:
    check_count(
        int(shapely.get_num_coordinates(polygon))
    )  # before it is mended, which takes minutes for a tangled ring
    if about.kind == "outline":
        found.shells.append(polygon)
        return
    found.outlines.append(Outline(polygon, {"door": "room", "wall": "solid"}.get(about.kind or "", about.kind)))  # type: ignore[arg-type]
    parts = areas(shapely.make_valid(polygon))
    if about.kind == "door":
        found.leaves += parts
    elif about.kind == "room":
        found.rooms += parts
        found.walled += parts if about.is_walled else []
