"""Drawings as other programs write them: what is hidden, light, painted over, or in other units; DXF and GeoJSON."""

import io
import json
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
from ezdxf import units

from chainslam.sim.worlds.readers.foreign import FORMATS
from tests.fuzzing.drawn_svg import DEFS, HIDDEN, NEVER_RENDERED, STYLE, UNKNOWN

from .case import Case, Rng, pick
from .plan import WALL_M, Plan, drawn, plan

LENGTHS = {units.M: 1.0, units.MM: 1e3, units.CM: 1e2, units.IN: 1 / 0.0254, units.FT: 1 / 0.3048}


def svg(of: Plan, more: str = "", whole_wall: bool = False) -> bytes:
    """Return the plan as an SVG drawing of metres, with more of it at the end."""
    lines = [*of.lines[:4], (of.x, 0.0, of.x, of.h)] if whole_wall else of.lines
    drawn_lines = "".join(
        f'<line x1="{a}" y1="{b}" x2="{c}" y2="{d}" stroke="black" stroke-width="{WALL_M}" stroke-linecap="square"/>'
        for a, b, c, d in lines
    )
    view = f'viewBox="-1 -1 {of.w + 2} {of.h + 2}" width="{of.w + 2}" height="{of.h + 2}"'
    space = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    return f"<svg {space} {view}>{STYLE}{DEFS}{drawn_lines}{more}</svg>".encode()


def block(rng: Rng, of: Plan, look: str) -> str:
    """Return a block of half a metre somewhere in the larger room."""
    low, high = (0.3, of.x - 0.9) if of.x > of.w / 2 else (of.x + 0.3, of.w - 0.9)
    x, y = rng.uniform(low, high), rng.uniform(0.3, of.h - 0.9)
    return f'<rect x="{x:.2f}" y="{y:.2f}" width=".5" height=".5" {look}/>'


def hidden(rng: Rng, folder: Path) -> Case:
    """What no viewer shows: in elements that are never rendered, of no opacity, clipped, not displayed."""
    of = plan(rng)
    inner = block(rng, of, 'fill="black"')
    if rng.random() < 0.5:
        name = pick(rng, NEVER_RENDERED)
        more = f"<{name}>{inner}</{name}>"
    else:
        more = f"<g {pick(rng, HIDDEN)}>{inner}</g>"
    return drawn(folder / "a.svg", svg(of, more), of.area)


def paints(rng: Rng, folder: Path) -> Case:
    """A light paint, with one beside it that no parser knows."""
    of = plan(rng)
    look = f'fill="#fff" style="fill:{pick(rng, UNKNOWN)};stroke:none"'
    return drawn(folder / "a.svg", svg(of, block(rng, of, look)), of.area)


def white_doors(rng: Rng, folder: Path) -> Case:
    """A door that is painted white over its wall: as a line, a rectangle, a path, in a group."""
    of = plan(rng)
    x, low, high = of.x, of.low, of.high
    shape = pick(
        rng,
        (
            f'<line x1="{x}" y1="{low}" x2="{x}" y2="{high}" stroke="white" stroke-width=".2"/>',
            f'<rect x="{x - 0.1}" y="{low}" width=".2" height="{high - low:.3f}" fill="white"/>',
            f'<path d="M{x - 0.1} {low}h.2V{high}h-.2z" style="FILL:#fefefe"/>',
            f'<g fill="#fff"><polygon points="{x - 0.2},{low} {x + 0.2},{low} {x + 0.2},{high} {x - 0.2},{high}"/></g>',
        ),
    )
    return drawn(folder / "a.svg", svg(of, shape, whole_wall=True), of.area)


def chosen(rng: Rng, folder: Path) -> Case:
    """Furniture and dimensions on layers of their own, left out by name."""
    of = plan(rng)
    label = pick(rng, ("furniture", "Möbel", "dim 1"))
    name = pick(
        rng, (f'id="{label}"', f'inkscape:label="{label}" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"')
    )
    pieces = [block(rng, of, look) for look in ('fill="black"', 'fill="none" stroke="#000"')]
    more = f"<g {name}>{''.join(pieces)}</g>"
    return drawn(folder / "a.svg", svg(of, more), of.area, without=(label,))


def dxf(rng: Rng, folder: Path) -> Case:
    """DXF of any unit and version."""
    of, (unit, size) = plan(rng), pick(rng, sorted(LENGTHS.items()))
    document = ezdxf.new(pick(rng, ("R2000", "R2010", "R2018")))
    document.units = unit
    for a, b, c, d in of.lines:
        document.modelspace().add_line((a * size, b * size), (c * size, d * size))
    text = io.StringIO()
    document.write(text)
    return drawn(folder / "a.dxf", document.encode(text.getvalue()), of.area)


def _geojson(of: Plan, place: Any = lambda x, y: [x, y], shut: bool = False) -> list[dict[str, Any]]:
    lines = [*of.lines[:4], (of.x, 0.0, of.x, of.h)] if shut else of.lines
    return [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {"type": "LineString", "coordinates": [place(a, b), place(c, d)]},
        }
        for a, b, c, d in lines
    ]


def _file(features: list[dict[str, Any]], crs: str = "") -> bytes:
    document: dict[str, Any] = {"type": "FeatureCollection", "features": features}
    if crs:
        document["crs"] = {"type": "name", "properties": {"name": crs}}
    return json.dumps(document).encode()


def reference_systems(rng: Rng, folder: Path) -> Case:
    """Degrees, Web Mercator, UTM, feet and others: converted, or refused by name."""
    of, path = plan(rng), folder / "a.geojson"
    latitude = float(rng.uniform(-60.0, 60.0))
    north, east = 111_200.0, 111_320.0 * np.cos(np.deg2rad(latitude))
    match int(rng.integers(4)):
        case 0:
            degrees = _geojson(of, lambda x, y: [8.0 + x / east, latitude + y / north])
            return drawn(path, _file(degrees, pick(rng, ("", "urn:ogc:def:crs:OGC:1.3:CRS84"))), of.area, near=0.03)
        case 1:
            grown = 1.0 / np.cos(np.deg2rad(latitude))
            y0 = 6378137.0 * np.log(np.tan(np.pi / 4 + np.deg2rad(latitude) / 2))
            mercator = _geojson(of, lambda x, y: [9e5 + grown * x, y0 + grown * y])
            return drawn(path, _file(mercator, "urn:ogc:def:crs:EPSG::3857"), of.area, near=0.03)
        case 2:
            utm = _geojson(of, lambda x, y: [5e5 + x, 5e6 + y])
            return drawn(path, _file(utm, f"urn:ogc:def:crs:EPSG::{int(rng.integers(32601, 32661))}"), of.area)
        case _:
            feet = _geojson(of, lambda x, y: [x / 0.3048, y / 0.3048])
            number = pick(rng, (2263, 2229, 6597, 3435))
            if rng.random() < 0.5:
                return drawn(path, _file(feet, f"EPSG:{number}"), of.area, "found the reference system")
            return drawn(path, _file(feet, f"EPSG:{number}"), of.area, scale=0.3048)


def doors_and_storeys(rng: Rng, folder: Path) -> Case:
    """Doors as lines and points on a shut wall, and other storeys beside: one is read."""
    of = plan(rng)
    door_m, key = of.high - of.low, pick(rng, ("level", "storey", "level_id"))
    middle = [of.x, (of.low + of.high) / 2]
    doors = (
        {"type": "LineString", "coordinates": [[of.x, of.low], [of.x, of.high]]},
        {"type": "Point", "coordinates": middle},
    )
    said = {pick(rng, ("kind", "indoor")): "door", "width": door_m}
    features = [*_geojson(of, shut=True), {"type": "Feature", "properties": said, "geometry": pick(rng, doors)}]
    for feature in features:
        feature["properties"] = {**feature["properties"], key: "0"}
    above = _geojson(plan(rng), lambda x, y: [0.5 * x, y])
    for feature in above:
        feature["properties"] = {key: "1"}
    return drawn(folder / "a.geojson", _file(features + above), of.area, level="0")


def foreign(rng: Rng, folder: Path) -> Case:
    """Formats that are not read are answered by their name."""
    suffix = pick(rng, sorted(FORMATS))
    return drawn(
        folder / f"a{suffix}", rng.bytes(100), 0.0, f"expected a drawing of a building, found {FORMATS[suffix][0]}"
    )
