"""Broken world files of every format: bytes changed, pieces spliced, values replaced by those that break readers."""

import gzip
import json
from functools import cache
from io import BytesIO, StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
from PIL import Image, ImageDraw

import chainslam.sim.worlds

BOX = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0], [4, 0, 4, 2.5], [4, 3.6, 4, 6]]
WORDS = ("NaN", "-1", "1e300", "1e-300", "-0", "9" * 400, '"\\ud800"', "null", "[]", "{}", "true", '""', "[[[[]]]]")
TEXTS = ("", "\ud800", "\x1b[2J", "$\\alpha{$", "start", "room", "solid", "\u202e", "x" * 300, "../../etc/passwd")
NUMBERS = (0, -1, 1, 1e300, -1e300, 1e-300, 1e9, 0.05, 10**400, True, 4.0, 8, 6, float("nan"), float("inf"))
TAGS = (
    *(b"!!float ", b"!!int ", b"!!bool ", b"&a ", b"*a", b"<<: *a"),
    *(b"[", b"{", b"- ", b": ", b"\n", b"'", b'"', b"|\n"),
)
MARKUP = (
    *(b"<g>", b"</g>", b"<use href='#a'/>", b" id='a'", b"transform='scale(0)'", b"Z", b"a1 1 0 0 1 1 1", b"1e999"),
    *(b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"&b;", b"fill='none'", b"viewBox='0 0 0 0'", b"%", b"rotate(", b"url(#a)"),
)


def damaged_file(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Change, cut, repeat and splice the bytes of a good file of any format."""
    name = str(rng.choice(sorted(good())))
    content = bytearray(good()[name])
    other = good()[str(rng.choice(sorted(good())))]
    for _ in range(int(rng.integers(1, 8))):
        at, length = int(rng.integers(0, len(content) + 1)), int(rng.integers(0, 30))
        match int(rng.integers(0, 6)):
            case 0:
                content[at : at + 1] = rng.bytes(1)
            case 1:
                del content[at : at + length]
            case 2:
                content[at:at] = rng.bytes(int(rng.integers(1, 9)))
            case 3:
                content[at:at] = content[at : at + length] * int(rng.integers(1, 40))
            case 4:
                begin = int(rng.integers(0, len(other)))
                content[at : at + length] = other[begin : begin + 5 * length]
            case _:
                content[at : at + length] = str(rng.choice(WORDS)).encode()
    return explored(rng, folder, name, bytes(content))


def other_values(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Replace, drop, repeat and nest values anywhere in a plan or a GeoJSON file."""
    name = str(rng.choice([name for name in sorted(good()) if name.endswith("json")]))
    document = json.loads(good()[name])
    for _ in range(int(rng.integers(1, 5))):
        document = _changed(rng, document)
    return explored(rng, folder, name, json.dumps(document).encode())


def other_words(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Put YAML's and SVG's own tricks where they are not expected."""
    name = str(rng.choice([name for name in sorted(good()) if name.endswith((".yaml", ".svg"))]))
    tricks = TAGS if name.endswith("yaml") else MARKUP
    content = bytearray(good()[name])
    for _ in range(int(rng.integers(1, 6))):
        at, length = int(rng.integers(0, len(content) + 1)), int(rng.integers(0, 12))
        content[at : at + length] = tricks[int(rng.integers(0, len(tricks)))] * int(rng.choice([1, 1, 1, 3, 500]))
    return explored(rng, folder, name, bytes(content))


def other_shapes(rng: np.random.Generator, folder: Path) -> list[list[str]]:
    """Draw walls, rings, paths or pixels by chance: crossing themselves, doubled, without area, far apart."""
    kind = str(rng.choice(["json", "geojson", "svg", "png"]))
    points = rng.uniform(-2, 12, (int(rng.integers(1, 60)), 2)) * float(rng.choice([1, 1, 1, 30, 1e-3, 1e4]))
    if rng.random() < 0.5:
        points = np.round(points)
    if rng.random() < 0.3:
        points = np.repeat(points, 2, axis=0)
    pairs = points.tolist()
    if kind == "json":
        walls = BOX + [[*a, *b] for a, b in pairwise(pairs)]
        content = json.dumps({"walls": walls, "start": pairs[0]}).encode()
    elif kind == "geojson":
        shapes = [{"type": "Polygon", "coordinates": [ring]} for ring in (pairs, pairs[:4], pairs[4:9], pairs[2:])]
        shapes += [{"type": "LineString", "coordinates": pairs}]
        kinds = [None, None, "room", "solid", "wall"]
        features = [
            {"type": "Feature", "properties": {"kind": kinds[int(rng.integers(0, 5))]}, "geometry": shape}
            for shape in shapes
            if rng.random() < 0.6
        ]
        content = json.dumps({"type": "FeatureCollection", "features": features}).encode()
    elif kind == "svg":
        letters = rng.choice(list("MLHVCSQTAZmlhvcsqtaz"), len(pairs))
        path = " ".join(f"{c} {x:g} {y:g} {y:g} {x:g} 0 1 1" for c, (x, y) in zip(letters, pairs, strict=True))
        content = good()["map.svg"].replace(b"</svg>", f'<path stroke="black" d="{path}"/></svg>'.encode())
    else:
        grey = rng.integers(0, 256, rng.integers(1, 60, 2)).astype(np.uint8)
        content = _encoded(Image.fromarray(np.kron(grey > 99, np.ones((4, 4))).astype(np.uint8) * 255), "PNG")
    return explored(rng, folder, f"map.{kind}", content)


def explored(rng: np.random.Generator, folder: Path, name: str, content: bytes) -> list[list[str]]:
    """Write the file, beside what a YAML file names, and return the command that explores it for a step or two."""
    for other in ("map.pgm", "map.png"):
        (folder / other).write_bytes(good()[other])
    (folder / name).write_bytes(content)
    words = ["explore", name, "--out", "out", "--max-steps", str(int(rng.integers(1, 3)))]
    if rng.random() < 0.15:
        words += ["--scale", str(rng.choice(["0", "-1", "1e-300", "0.02", "1e300", "nan"]))]
    if rng.random() < 0.15:
        words += ["--start", *map(str, rng.choice(["0", "4", "3", "1e300", "nan", "-1"], 2))]
    return [words]


def _changed(rng: np.random.Generator, value: Any) -> Any:
    """Return a document with one value in it, found by walking down by chance, made another."""
    inner = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else []
    if len(inner) and rng.random() < 0.85:
        key = inner[int(rng.integers(0, len(inner)))]
        match int(rng.integers(0, 12)):
            case 0:
                del value[key]
            case 1 if isinstance(value, list):
                value[key:key] = [value[key]] * int(rng.integers(1, 30))
            case 2 if isinstance(value, dict):
                value[str(rng.choice(TEXTS))] = value[key]
            case _:
                value[key] = _changed(rng, value[key])
        return value
    match int(rng.integers(0, 5)):
        case 0:
            return NUMBERS[int(rng.integers(0, len(NUMBERS)))]
        case 1:
            return TEXTS[int(rng.integers(0, len(TEXTS)))]
        case 2:
            nested = value
            for _ in range(int(rng.choice([1, 2, 30]))):
                nested = [nested]
            return nested
        case 3:
            return None
        case _:
            return {} if rng.random() < 0.5 else []


@cache
def good() -> dict[str, bytes]:
    """Return a good file of each format by its name."""
    image = Image.new("L", (170, 130), 254)
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, 0, 169, 129), outline=0, width=3)
    draw.rectangle((60, 50, 80, 70), fill=0)
    ring = [[0, 0], [8, 0], [8, 6], [0, 6], [0, 0]]
    hole = [[3, 3], [4, 3], [4, 4], [3, 4], [3, 3]]
    lines = [{"type": "LineString", "coordinates": [wall[:2], wall[2:]]} for wall in BOX]
    point = {"type": "Point", "coordinates": [1, 1]}
    rooms = [
        {
            "type": "Feature",
            "properties": {"kind": "room"},
            "geometry": {"type": "Polygon", "coordinates": [ring, hole]},
        },
        {"type": "Feature", "properties": None, "geometry": {"type": "Polygon", "coordinates": [hole]}},
        {"type": "Feature", "id": "start", "properties": {"heading": 1.5}, "geometry": point},
        {"type": "Feature", "properties": {"name": "A"}, "geometry": point},
    ]
    drawn = [{"type": "Feature", "properties": {}, "geometry": line} for line in lines]
    own = {"coordinate_system": "local metres", "format": 1}
    chain = {"kind": "chain", "contour": "room", "closed": True}
    chains = [{"type": "Feature", "properties": chain, "geometry": {"type": "Polygon", "coordinates": [ring]}}, *drawn]
    yaml = "image: map.pgm\nresolution: 0.05\norigin: [0.0, -1.0, 0.1]\nnegate: 0\n"
    return {
        "plan.json": json.dumps({"walls": BOX, "start": [1, 1], "labels": {"A": [0, 0], "B": [8, 0]}}).encode(),
        "rooms.geojson": json.dumps({"type": "FeatureCollection", "features": rooms}).encode(),
        "lines.geojson": json.dumps({"type": "FeatureCollection", "features": [*drawn, *rooms[2:]]}).encode(),
        "own.geojson": json.dumps({"type": "FeatureCollection", "features": chains, **own}).encode(),
        "map.svg": (Path(chainslam.sim.worlds.__file__).parent / "bundled" / "rooms.svg").read_bytes(),
        "map.svgz": gzip.compress(
            (Path(chainslam.sim.worlds.__file__).parent / "bundled" / "rooms.svg").read_bytes(), mtime=0
        ),
        "map.dxf": _dxf(),
        "map.yaml": f"{yaml}occupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n".encode(),
        "map.pgm": _encoded(image, "PPM"),
        "map.png": _encoded(image, "PNG"),
        **{f"map.{kind.lower()}": _encoded(image, kind) for kind in ("BMP", "GIF", "TIFF", "WEBP", "JPEG")},
        "clear.png": _encoded(image.convert("LA"), "PNG"),
    }


def _dxf() -> bytes:
    document = ezdxf.new("R2010")
    document.units = ezdxf.units.M
    space, block = document.modelspace(), document.blocks.new("PILLAR")
    block.add_circle((0, 0), 0.3)
    for x0, y0, x1, y1 in BOX:
        space.add_lwpolyline([(x0, y0), (x1, y1)], dxfattribs={"layer": "WALLS"})
    space.add_blockref("PILLAR", (6, 3))
    space.add_arc((4, 2.5), 1.1, 0, 90, dxfattribs={"layer": "DOORS"})
    text = StringIO()
    document.write(text)
    return document.encode(text.getvalue())


def _encoded(image: Image.Image, kind: str) -> bytes:
    buffer = BytesIO()
    image.save(buffer, kind)
    return buffer.getvalue()
