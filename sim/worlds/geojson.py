"""GeoJSON in metres: LineStrings are walls, Polygons are solid obstacles, named Points are the start and labels.

A Point whose id, or property `id` or `name`, is `start` marks the start (property `heading` in rad, optional);
any other named Point is a label. Longitude and latitude are refused: the plane of a building is in metres.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float

from .drawing import Drawing, WorldError, numbers, shorten

PIECES_MAX = 500_000


def from_geojson(document: dict[str, Any]) -> Drawing:
    """Return the drawing of a parsed GeoJSON object; raise WorldError where it is not GeoJSON in metres."""
    lines: list[shapely.LineString] = []
    solids: list[shapely.Polygon] = []
    points: dict[str, Float[np.ndarray, 3]] = {}
    for geometry, name, heading in _geometries(document, None, 0.0, 0):
        kind, coordinates = geometry.get("type"), geometry.get("coordinates")
        if kind == "Point":
            at = _position(coordinates)
            points |= {} if name is None else {name: np.array([at[0], at[1], heading])}
        elif kind in ("LineString", "MultiLineString"):
            for line in [coordinates] if kind == "LineString" else _list(coordinates, kind):
                path = _path(line, 2)
                lines += [shapely.LineString(path)] if np.ptp(path, axis=0).any() else []
        elif kind in ("Polygon", "MultiPolygon"):
            for rings in [coordinates] if kind == "Polygon" else _list(coordinates, kind):
                paths = [_path(ring, 4) for ring in _list(rings, kind)]
                solids += [shapely.Polygon(paths[0], paths[1:])] if paths else []
        elif kind != "MultiPoint":
            raise WorldError(f"expected a GeoJSON geometry, found type {shorten(kind)}: correct the file")
    if _is_geographic(document, lines, solids):
        raise WorldError(
            "expected GeoJSON in metres, found longitudes and latitudes: project the file to metres (a UTM zone, say)"
        )
    start = points.pop("start", None)
    return Drawing(tuple(lines), tuple(solids), start, {k: (float(p[0]), float(p[1])) for k, p in points.items()})


def _geometries(
    node: Any, name: str | None, heading: float, depth: int
) -> Iterator[tuple[dict[str, Any], str | None, float]]:
    """Yield the plain geometries of a GeoJSON object with the name and heading of their feature."""
    if node is None:
        return
    if not isinstance(node, dict) or depth > 20:
        raise WorldError(f"expected a GeoJSON object, found {shorten(node)}: correct the file")
    kind = node.get("type")
    if kind == "FeatureCollection":
        for feature in _list(node.get("features"), "features"):
            yield from _geometries(feature, None, 0.0, depth + 1)
    elif kind == "GeometryCollection":
        for part in _list(node.get("geometries"), "geometries"):
            yield from _geometries(part, name, heading, depth + 1)
    elif kind == "Feature":
        properties = node.get("properties") or {}
        if not isinstance(properties, dict):
            raise WorldError(f"expected properties to be an object, found {shorten(properties)}: correct the file")
        names = (node.get("id"), properties.get("id"), properties.get("name"))
        called = [str(n) for n in names if isinstance(n, str | int) and not isinstance(n, bool)]
        turn = numbers([properties.get("heading", 0.0)], (1,), "heading", "1.57")
        best = "start" if "start" in called else called[-1] if called else None
        yield from _geometries(node.get("geometry"), best, float(turn[0]), depth + 1)
    else:
        yield node, name, heading


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
