"""GeoJSON in metres: LineStrings are walls, Polygons rooms or solid, named Points are the start and labels.

A Point whose id, or property `id` or `name`, is `start` marks the start (property `heading` in rad, optional);
any other named Point is a label. A property says what a Polygon is (`kind`, `type`, ...: `room`, `solid`, ...); where
none does, `rooms` says how its shape decides. A map that this program wrote is a world again: its closed chains are
rooms and islands, its open chains walls. Longitude and latitude are refused: the plane of a building is in metres.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float

from ..drawing import Drawing, WorldError, counted, numbers, shorten
from ..limits import check_labels, check_size
from ..rooms import WALL_M, Kind, Outline, areas, plan_of
from ..text import name_of

PIECES_MAX = 500_000
ROOMS = ("room", "floor", "space", "hall", "corridor", "hallway", "passage", "door", "doorway", "area", "free")
SOLIDS = ("solid", "wall", "obstacle", "island", "pillar", "column", "furniture", "block")
WORDS: dict[str, Kind] = {**dict.fromkeys(ROOMS, "room"), **dict.fromkeys(SOLIDS, "solid")}
KEYS = ("contour", "kind", "type", "class", "category", "indoor")
OWN = "coordinate_system"
"""A member that the maps have that this program writes; of these only chains and the start are read."""
OWN_KINDS = ("chain", "start")


@dataclass
class _Found:
    """What has been read so far."""

    lines: list[shapely.LineString] = field(default_factory=list)
    outlines: list[Outline] = field(default_factory=list)
    points: dict[str, Float[np.ndarray, "3"]] = field(default_factory=dict)


@dataclass(frozen=True)
class _About:
    """What a feature says of its geometry."""

    name: str | None = None
    heading: float = 0.0
    kind: Kind | None = None
    unknown: str = ""
    """Its property `kind`, where that is no word for a room or something solid and no other property is one."""
    is_own: bool = False
    """Whether it is a part of a map that this program wrote."""


def from_geojson(document: dict[str, Any]) -> Drawing:
    """Return the drawing of a parsed GeoJSON object; raise WorldError where it is not GeoJSON in metres."""
    found = _Found()
    for geometry, about in _geometries(document, _About(), 0, OWN in document):
        _add(found, geometry, about)
    polygons = [outline.polygon for outline in found.outlines]
    if _is_geographic(document, found.lines, polygons):
        raise WorldError(
            "expected GeoJSON in metres, found longitudes and latitudes: project the file to metres (a UTM zone, say)"
        )
    check_size(found.lines, polygons)
    start = found.points.pop("start", None)
    check_labels(found.points)
    plan = plan_of(found.outlines, found.lines)
    guessed = any(outline.kind is None for outline in found.outlines)
    words = [
        counted(plan.rooms, "polygon as a room", "polygons as rooms"),
        counted(len(polygons) - plan.rooms, "polygon as solid", "polygons as solid"),
        counted(len(found.lines), "line as a wall", "lines as walls"),
    ]
    said = ", ".join(word for word in words if word)
    said += " (by their shape; a property kind of room or solid says it)" if guessed else ""
    labels = {name: (float(at[0]), float(at[1])) for name, at in found.points.items()}
    return Drawing(tuple(found.lines), plan.solids, start, labels, understood=said, scale="in metres")


def _add(found: _Found, geometry: dict[str, Any], about: _About) -> None:
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind == "Point":
        at = _position(coordinates)
        found.points |= {} if about.name is None else {about.name: np.array([at[0], at[1], about.heading])}
    elif kind in ("LineString", "MultiLineString"):
        for line in [coordinates] if kind == "LineString" else _list(coordinates, kind):
            path = _path(line, 2)
            if np.ptp(path, axis=0).any():
                _add_line(found, shapely.LineString(path), about)
    elif kind in ("Polygon", "MultiPolygon"):
        if about.unknown:
            raise WorldError(
                f"expected a polygon of kind room or solid, found {about.unknown}: use such a word, or leave kind out"
            )
        for rings in [coordinates] if kind == "Polygon" else _list(coordinates, kind):
            paths = [_path(ring, 4) for ring in _list(rings, kind)]
            found.outlines += [Outline(shapely.Polygon(paths[0], paths[1:]), about.kind)] if paths else []
    elif kind != "MultiPoint":
        raise WorldError(f"expected a GeoJSON geometry, found type {shorten(kind)}: correct the file")


def _add_line(found: _Found, line: shapely.LineString, about: _About) -> None:
    if not about.is_own:
        found.lines.append(line)
        return
    # An open chain is the face of a wall: the free side is on its left, and all of the wall on its right.
    band = shapely.make_valid(line.buffer(-WALL_M, single_sided=True, join_style="mitre"))
    found.outlines += [Outline(part, "solid") for part in areas(band)]


def _geometries(node: Any, about: _About, depth: int, is_own: bool) -> Iterator[tuple[dict[str, Any], _About]]:
    """Yield the plain geometries of a GeoJSON object with what their feature says."""
    if node is None:
        return
    if not isinstance(node, dict) or depth > 20:
        raise WorldError(f"expected a GeoJSON object, found {shorten(node)}: correct the file")
    kind = node.get("type")
    if kind == "FeatureCollection":
        for feature in _list(node.get("features"), "features"):
            yield from _geometries(feature, _About(), depth + 1, is_own)
    elif kind == "GeometryCollection":
        for part in _list(node.get("geometries"), "geometries"):
            yield from _geometries(part, about, depth + 1, is_own)
    elif kind == "Feature":
        properties = node.get("properties") or {}
        if not isinstance(properties, dict):
            raise WorldError(f"expected properties to be an object, found {shorten(properties)}: correct the file")
        if not is_own or properties.get("kind") in OWN_KINDS:
            yield from _geometries(node.get("geometry"), _about(node.get("id"), properties, is_own), depth + 1, is_own)
    else:
        yield node, about


def _about(number: Any, properties: dict[str, Any], is_own: bool) -> _About:
    names = (number, properties.get("id"), properties.get("name"))
    called = [str(n) for n in names if isinstance(n, str | int) and not isinstance(n, bool)]
    turn = numbers([properties.get("heading", 0.0)], (1,), "heading", "1.57")
    best = "start" if "start" in called else name_of(called[-1]) if called else None
    values = [properties.get(key) for key in KEYS]
    kinds = [WORDS[value.lower()] for value in values if isinstance(value, str) and value.lower() in WORDS]
    unknown = shorten(said) if not kinds and not is_own and (said := properties.get("kind")) is not None else ""
    return _About(best, float(turn[0]), kinds[0] if kinds else None, unknown, is_own)


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list) or len(value) > PIECES_MAX:
        raise WorldError(f"expected {what} to hold a list, found {shorten(value)}: correct the file")
    return value


def _position(value: Any) -> Float[np.ndarray, "2"]:
    return numbers(value, (2, 3), "a position", "[x, y]")[:2]


def _path(value: Any, least: int) -> Float[np.ndarray, "n 2"]:
    path = [_position(position) for position in _list(value, "coordinates")]
    if len(path) < least:
        raise WorldError(f"expected {least} or more positions, found {len(path)}: correct the line or ring")
    return np.array(path)


def _is_geographic(document: dict[str, Any], lines: list[shapely.LineString], solids: list[shapely.Polygon]) -> bool:
    """Return whether this is surely longitude and latitude: it says so, or would be a speck far from the origin."""
    crs = str(document.get("crs", "")).upper()
    if "CRS84" in crs or "EPSG::4326" in crs or "EPSG:4326" in crs:
        return True
    if not lines and not solids:
        return False
    x0, y0, x1, y1 = shapely.total_bounds(np.array([*lines, *solids], dtype=object))
    inside = max(abs(x0), abs(x1)) <= 180 and max(abs(y0), abs(y1)) <= 90
    return bool(inside and max(x1 - x0, y1 - y0) < 0.5 and max(abs(x0), abs(y0)) > 1)
