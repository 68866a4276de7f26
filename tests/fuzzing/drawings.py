"""Drawings as other programs write them: SVG that hides and shows, DXF with broken codes, GeoJSON of storeys."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.sim.worlds.readers.geojson.words import WORDS as WORDS_OF_FEATURES

from .drawn_svg import drawn_svg
from .worlds import TEXTS, explored, good


def svg(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Draw SVG files of everything that decides what is shown, and now and then choose among its layers."""
    words = explored(rng, folder, "map.svg", drawn_svg(rng))[0]
    if rng.random() < 0.3:
        words += [
            str(rng.choice(["--layers", "--ids", "--without"])),
            str(rng.choice(["walls", "*", "block", "", "[", "no"])),
        ]
    return [words]


def codes(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Replace, drop, repeat and swap pairs of code and value in a DXF file."""
    lines = good()["map.dxf"].decode("cp1252").splitlines()
    numbers = "0", "2", "5", "8", "10", "20", "30", "40", "62", "66", "70", "90", "100", "330", "999", "-1", "x"
    values = *TEXTS[:4], "INSERT", "LWPOLYLINE", "ENDSEC", "SPLINE", "1e300", "-1", "nan", "ENTITIES", "9" * 30
    for _ in range(int(rng.integers(1, 8))):
        at = 2 * int(rng.integers(0, len(lines) // 2))
        match int(rng.integers(0, 4)):
            case 0:
                lines[at] = str(rng.choice(numbers))
            case 1:
                lines[at + 1 : at + 2] = [str(rng.choice(values))]
            case 2:
                del lines[at : at + 2 * int(rng.integers(1, 20))]
            case _:
                lines[at:at] = lines[at : at + 2 * int(rng.integers(1, 40))]
    content = "\n".join(lines).encode("utf-8", "replace")
    return explored(rng, folder, "map.dxf", content)


def storeys(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Put the properties and reference systems of indoor tools, right and wrong ones, onto rooms and lines."""
    kinds = *WORDS_OF_FEATURES, None, 3, "romo", "", "DOOR"
    values = "0", "1", 0, 1.5, "-1;0", "0-3", "9-0", "0-99999", None, True, [], "EG", "\ud800"
    features = []
    for _ in range(int(rng.integers(1, 9))):
        x, y, w, h = (float(v) for v in np.round(rng.uniform([0, 0, 1, 1], [8, 6, 6, 5])))
        ring = [[x, y], [x + w, y], [x + w, y + h], [x, y + h], [x, y]]
        shape = [("Polygon", [ring]), ("LineString", ring[:2]), ("Point", [x, y])][int(rng.integers(0, 3))]
        said = {
            str(rng.choice(["kind", "indoor", "type", "door", "highway", "name", "width"])): kinds[
                int(rng.integers(len(kinds)))
            ],
            str(rng.choice(["level", "storey", "level_id", "ordinal"])): values[int(rng.integers(len(values)))],
        }
        features.append(
            {"type": "Feature", "properties": said, "geometry": dict(zip(("type", "coordinates"), shape, strict=True))}
        )
    document: dict[str, Any] = {"type": "FeatureCollection", "features": features}
    if rng.random() < 0.4:
        names = "EPSG:4326", "EPSG:3857", "EPSG:32632", "EPSG:2263", "CRS84", "EPSG:", "", None, 4326, {}
        document["crs"] = {"type": "name", "properties": {"name": names[int(rng.integers(len(names)))]}}
    words = explored(rng, folder, "map.geojson", json.dumps(document).encode())[0]
    return [words + (["--level", str(rng.choice(["0", "1", "EG", "", "x"]))] if rng.random() < 0.4 else [])]
