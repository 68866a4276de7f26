"""The dimensions of a map as data: for JSON, for a table, and as GeoJSON in the frame of the map."""

import json
from itertools import count
from typing import Any

import numpy as np
import shapely
from shapely.affinity import rotate
from shapely.geometry.base import BaseGeometry

from ...artifacts.files import stamp
from ...artifacts.maps.geojson import FRAME, LOCAL_METRES
from .layout import loose, sheet_of, words
from .measuring import Dimension, Kind
from .structure import Structure
from .survey import Survey

HEAD = ("dimension", "value and 95 % interval", "walls")
RELATED = ("relation", "walls", "probability", "used")
ROUGH = "*"
"""Marks a dimension to an end that is no corner."""
SHOWN = 6
"""Of more walls the table tells only how many."""


def named(found: Survey) -> list[tuple[str, Dimension]]:
    """Return all dimensions with their names: what is measured, and its number among those."""
    counters = {kind: count(1) for kind in Kind}
    return [(f"{each.kind} {next(counters[each.kind])}", each) for each in found.dimensions]


def dimension_record(found: Survey, name: str, each: Dimension) -> dict[str, Any]:
    """Return a dimension as data; an interval of metres or square metres."""
    unit = "m2" if each.kind is Kind.AREA else "m"
    return {
        "name": name,
        "kind": str(each.kind),
        f"value_{unit}": each.measured.value,
        f"sigma_{unit}": each.measured.sigma,
        f"interval_{unit}": list(each.measured.interval),
        "walls": found.faces.ids[list(each.walls)],
        "ends_m": each.ends_world,
        "between_corners": each.is_firm,
    }


def direction_record(found: Survey) -> dict[str, Any]:
    """Return the main direction of the walls as data, degrees from the x axis of the map, modulo 90."""
    low, high = np.rad2deg(found.direction.interval).tolist()
    return {"value_deg": float(np.rad2deg(found.direction.value)), "interval_deg": [low, high]}


def dimension_rows(found: Survey) -> list[tuple[str, ...]]:
    """Return the rows of the table of dimensions."""
    rows: list[tuple[str, ...]] = []
    for name, each in named(found):
        walls = ", ".join(map(str, found.faces.ids[list(each.walls)].tolist()))
        value = f"{words(each.measured, 3)} {each.unit}{'' if each.is_firm else ROUGH}"
        rows.append((name, value, walls if len(each.walls) <= SHOWN else f"{len(each.walls)} walls"))
    return rows


def structure_record(found: Structure) -> dict[str, Any]:
    """Return the relations of walls as data."""
    return {
        "tolerance_deg": float(np.rad2deg(found.tolerance_rad)),
        "hypotheses": [
            {"relation": str(each.relation), "walls": found.faces.ids[list(each.walls)],
             "probability": each.probability, "used": each.is_used}
            for each in found.hypotheses
        ],
    }  # fmt: skip


def structure_rows(found: Structure) -> list[tuple[str, ...]]:
    """Return the rows of the table of relations."""
    return [
        (str(each.relation), ", ".join(map(str, found.faces.ids[list(each.walls)].tolist())),
         f"{each.probability:.4f}", "yes" if each.is_used else "no")
        for each in found.hypotheses
    ]  # fmt: skip


def plan_geojson(found: Survey, title: str) -> dict[str, Any]:
    """Return the plan in local metres of the map's frame: walls, rooms, dimensions and loose things, by `layer`."""
    sheet = sheet_of(found, title)
    features = [
        _shape(sheet.both, sheet.turn_rad, "walls-solid"),
        _shape(sheet.one, sheet.turn_rad, "walls-one-face"),
        *(_room(found, k) for k in range(len(found.rooms))),
        *(_line(found.faces.ends_world[row], "walls", id=int(found.faces.ids[row]))
          for row in range(len(found.faces)) if row not in found.furniture | found.clutter),
        *(_line(each.ends_world, "dimensions", **dimension_record(found, name, each))
          for name, each in named(found) if each.kind not in (Kind.AREA, Kind.PERIMETER)),
        *(_line(ends, layer) for layer, lines in loose(found).items() for ends in lines),
    ]  # fmt: skip
    return {
        "type": "FeatureCollection",
        "name": title,
        **stamp(),
        "crs": {"type": "name", "properties": {"name": LOCAL_METRES}},
        "coordinate_system": FRAME,
        "main_direction": direction_record(found),
        "features": features,
    }


def _feature(geometry: dict[str, Any], layer: str, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": {"layer": layer, **properties}}


def _line(ends: np.ndarray, layer: str, **properties: Any) -> dict[str, Any]:
    return _feature({"type": "LineString", "coordinates": ends}, layer, **properties)


def _shape(shape: BaseGeometry, turn: float, layer: str) -> dict[str, Any]:
    return _feature(json.loads(shapely.to_geojson(rotate(shape, -turn, origin=(0.0, 0.0), use_radians=True))), layer)


def _room(found: Survey, number: int) -> dict[str, Any]:
    room = found.rooms[number]
    rings = [np.concatenate([ring, ring[:1]]) for ring in (room.outline_world, *room.holes_world)]
    return _feature(
        {"type": "Polygon", "coordinates": rings}, "rooms", room=number + 1,
        area_m2=room.area.measured.value, area_interval_m2=list(room.area.measured.interval),
        perimeter_m=room.perimeter.measured.value, perimeter_interval_m=list(room.perimeter.measured.interval),
        openings=room.openings, gaps=room.unseen,
    )  # fmt: skip
