"""Whatever a file holds, load gives a World or one line that tells what is wrong."""

import json
import re
import struct
import zlib

import numpy as np
import pytest
from PIL import Image
from shapely.errors import GEOSException

from chainslam.sim.worlds import DrawingOptions, World, WorldError, load, registry
from chainslam.sim.worlds.readers.geojson import features

BOX = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0]]
NS = 'xmlns="http://www.w3.org/2000/svg"'
ROOM = '<rect id="r" width="8" height="6" fill="none" stroke="black"/>'
LAUGHS = '<!DOCTYPE svg [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;">]>'
USES = "".join(
    f'<g id="u{i}"><use href="#u{i + 1}"/><use href="#u{i + 1}"/><use href="#u{i + 1}"/></g>' for i in range(30)
)


def _plan(**changes: object) -> str:
    return json.dumps({"walls": BOX, "start": [4, 3], **changes})


def _laughs(more: str) -> str:
    lines = ["l0: &l0 {a: 1}", *(f"l{i}: &l{i} " + more.format(f"*l{i - 1}") for i in range(1, 30))]
    return "\n".join([*lines, "image: b.pgm", "resolution: 0.05"])


def _geo(kind: str, coordinates: object) -> str:
    return json.dumps({"type": kind, "coordinates": coordinates})


def _feature(**properties: object) -> str:
    square = {"type": "Polygon", "coordinates": [[[0, 0], [6, 0], [6, 6], [0, 6], [0, 0]]]}
    return json.dumps({"type": "Feature", "properties": properties, "geometry": square})


def _points() -> str:
    one = {"type": "Point", "coordinates": [1, 1]}
    points = [{"type": "Feature", "id": f"p{i}", "geometry": one} for i in range(201)]
    room = {"type": "LineString", "coordinates": [[0, 0], [6, 0], [6, 6], [0, 6], [0, 0]]}
    return json.dumps({"type": "FeatureCollection", "features": [*points, {"type": "Feature", "geometry": room}]})


def _svg(more: str) -> str:
    return f"<svg {NS}>{ROOM}{more}</svg>"


def _map(more: str) -> str:
    return f"image: b.pgm\nresolution: 0.05\n{more}"


def _png(width: int, height: int) -> bytes:
    """Return a PNG that only claims its size."""
    head = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    head = struct.pack(">I", 13) + head + struct.pack(">I", zlib.crc32(head))
    return b"\x89PNG\r\n\x1a\n" + head + struct.pack(">I", 9) + b"IDAT"


BAD: dict[str, tuple[str, str | bytes, str]] = {
    "empty": ("a.json", "", "0 bytes"),
    "not json": ("a.json", "walls", "expected JSON"),
    "binary": ("a.json", bytes(range(256)), "expected JSON"),
    "deep": ("a.json", "[" * 100_000, "expected JSON"),
    "list": ("a.json", "[1, 2]", '"walls"'),
    "no walls": ("a.json", _plan(walls=[]), "expected walls, found none"),
    "walls of 3": ("a.json", _plan(walls=[[0, 0, 1]]), "wall 0"),
    "wall text": ("a.json", _plan(walls=[["0", 0, 1, 1]]), "wall 0"),
    "walls object": ("a.json", _plan(walls={"a": 1}), "list"),
    "nan": ("a.json", '{"walls": [[0, 0, NaN, 1]]}', "finite"),
    "inf": ("a.json", '{"walls": [[0, 0, 1e999, 1]]}', "finite"),
    "huge int": ("a.json", '{"walls": [[0, 0, 1' + "0" * 400 + ", 1]]}", "finite"),
    "bool": ("a.json", _plan(walls=[[0, 0, True, 1]]), "finite"),
    "points only": ("a.json", _plan(walls=[[1, 1, 1, 1]]), "expected walls, found none"),
    "too big": ("a.json", _plan(walls=[[0, 0, 1e4, 0]]), "1000 m"),
    "too far": ("a.json", _plan(walls=[*BOX, [0, 0, 1e300, 0]]), "1e+07 m"),
    "too small": ("a.json", _plan(walls=[[0, 0, 0.1, 0]]), "1000 m"),
    "start in wall": ("a.json", _plan(start=[0.01, 3]), "inside a wall"),
    "start near wall": ("a.json", _plan(start=[0.2, 3]), "0.150 m"),
    "start outside": ("a.json", _plan(start=[-3, 3]), "outside"),
    "start text": ("a.json", _plan(start="here"), "start"),
    "labels list": ("a.json", _plan(labels=[1]), "labels"),
    "open": ("a.json", _plan(walls=BOX[:3], start=None), "closed wall"),
    "geo unknown": ("a.geojson", _geo("Ball", [1]), "type"),
    "geo null": ("a.geojson", '{"type": "Feature", "geometry": null}', "expected walls, found none"),
    "geo shape": ("a.geojson", _geo("LineString", [[0, 0], 3]), "position"),
    "geo ring": ("a.geojson", _geo("Polygon", [[[0, 0], [1, 1]]]), "4 or more"),
    "geo kind": ("a.geojson", _feature(kind="romo"), "of kind room or solid, found 'romo'"),
    "geo kind number": ("a.geojson", _feature(kind=3), "of kind room or solid, found 3"),
    "geo list": ("a.geojson", '{"type": "FeatureCollection", "features": {}}', "features to hold a list"),
    "geo no feature": ("a.geojson", '{"type": "FeatureCollection", "features": [3]}', "a GeoJSON object, found 3"),
    "geo properties": ("a.geojson", '{"type": "Feature", "properties": [1]}', "properties to be an object"),
    "geo collection": ("a.geojson", '{"type": "GeometryCollection", "geometries": 1}', "geometries to hold a list"),
    "geo points": ("a.geojson", _points(), "at most 200 named points, found 201"),
    "svg labels": ("a.svg", _svg("".join(f'<path id="label-{i}" d="M1 1h1"/>' for i in range(201))), "named points"),
    "geo nested": ("a.geojson", '{"type":"Feature","geometry":' * 60 + "null" + "}" * 60, "GeoJSON object"),
    "svg entities": ("a.svg", f"{LAUGHS}<svg {NS}><text>&b;</text>{ROOM}</svg>", "entity"),
    "svg external": ("a.svg", f'<!DOCTYPE s [<!ENTITY x SYSTEM "file:///etc/passwd">]><svg {NS}>&x;</svg>', "entity"),
    "svg uses": ("a.svg", f'<svg {NS}>{ROOM}{USES}<g id="u30"><path d="M0 0H1"/></g></svg>', "<use>"),
    "svg loop": ("a.svg", f'<svg {NS}>{ROOM}<g id="a"><use href="#a"/></g></svg>', "<use>"),
    "svg broken": ("a.svg", "<svg><rect", "broken XML"),
    "html": ("a.svg", "<html></html>", "<svg>"),
    "svg empty": ("a.svg", f"<svg {NS}/>", "draw the walls"),
    "svg light": ("a.svg", f'<svg {NS}><rect width="8" height="6" stroke="#eee" fill="none"/></svg>', "draw the walls"),
    "svg pixels": ("a.svg", f'<svg {NS}><rect width="800" height="600" stroke="red" fill="none"/></svg>', "per-unit"),
    "svg paper": ("a.svg", f'<svg {NS} width="21cm" viewBox="0 0 210 297">{ROOM}</svg>', "1000 m"),
    "svg scale": ("a.svg", f'<svg {NS} data-metres-per-unit="big">{ROOM}</svg>', "above 0"),
    "svg view box": ("a.svg", f'<svg {NS} viewBox="0 0 8">{ROOM}</svg>', "viewBox"),
    "svg nan": (
        "a.svg",
        f'<svg {NS} data-metres-per-unit="1">{ROOM}<path d="M0 0 L1e999 5" stroke="red"/></svg>',
        "finite coordinates",
    ),
    **{
        f"svg view box {box}": ("a.svg", f'<svg {NS} viewBox="{box}">{ROOM}</svg>', 'viewBox="x y width height"')
        for box in ("nan 0 8 6", "0 inf 8 6", "0 0 0 6", "0 0 inf 6", "0 0 8 -6", "0 0 8 nan")
    },
    "svg page": ("a.svg", f'<svg {NS} width="widecm">{ROOM}</svg>', "a length such as 900cm"),
    "svg path": ("a.svg", _svg('<path transform="rotate(a)" d="M1 1h1" stroke="black"/>'), "one that cannot be read"),
    "svg heading": ("a.svg", _svg('<path id="start" data-heading-deg="north" d="M1 1h1"/>'), "could not convert"),
    "svg label nowhere": ("a.svg", _svg('<path id="label-a" d="M1e999 1h1"/>'), "finite coordinates"),
    "svg far": (
        "a.svg",
        f'<svg {NS} data-metres-per-unit="1">{ROOM}<path d="M0 0 L1e9 5" stroke="red"/></svg>',
        "from the origin",
    ),
    "svg no outer wall": ("a.svg", f'<svg {NS}><rect width="2" height="2"/></svg>', "closed wall"),
    "png text": ("a.png", "hello", "found another or a broken one"),
    "float picture": ("a.pgm", b"Pf\n2 2\n-1.0\n" + bytes(16), "floating point"),
    "png bomb": ("a.png", _png(60_000, 60_000), "megapixels"),
    "png large": ("a.png", _png(8_000, 8_000), "megapixels"),
    "png thin": ("a.png", _png(1, 50), "2 to 20000 pixels a side"),
    "png long": ("a.png", _png(2, 20_001), "2 to 20000 pixels a side"),
    "png cut": ("a.png", _png(100, 100), "PNG"),
    "pgm cut": ("a.pgm", b"P5\n100 100\n255\n\0\0", "PNG or PGM"),
    "pgm sizes": ("a.pgm", b"P5\n-5 100\n255\n", "PNG or PGM"),
    "yaml tags": ("a.yaml", "!!python/object/apply:os.system ['true']", "YAML"),
    "yaml list": ("a.yaml", "- 1", "YAML"),
    "yaml broken": ("a.yaml", "a: [", "YAML"),
    "yaml no image": ("a.yaml", "resolution: 0.05", "image"),
    "yaml missing": ("a.yaml", "image: b.pgm\nresolution: 0.05", "no such file"),
    "yaml outside": ("a.yaml", "image: ../../etc/passwd\nresolution: 0.05", "folder"),
    "yaml absolute": ("a.yaml", "image: /etc/passwd\nresolution: 0.05", "folder"),
    "yaml resolution": ("a.yaml", "image: b.pgm\nresolution: -1", "resolution"),
    "yaml laughs": ("a.yaml", _laughs("[{0}, {0}, {0}, {0}]"), "alias"),
    "yaml merges": ("a.yaml", _laughs("{{<<: [{0}, {0}, {0}]}}"), "alias"),
    "yaml float": ("a.yaml", 'image: b.pgm\nresolution: !!float ""', "tag"),
    "yaml int": ("a.yaml", 'image: b.pgm\nresolution: !!int ""', "tag"),
    "yaml bool": ("a.yaml", "image: b.pgm\nresolution: !!bool foo", "tag"),
    "yaml timestamp": ("a.yaml", "image: b.pgm\nresolution: !!timestamp foo", "tag"),
    "yaml local tag": ("a.yaml", "image: ! b.pgm\nresolution: 1", "tag"),
    "yaml tag of all": ("a.yaml", "!!omap [a: 1]", "tag"),
    "yaml surrogate": ("a.yaml", 'image: "b\\ud800.pgm"\nresolution: 0.05', "picture"),
    "yaml escape": ("a.yaml", 'image: "\\e[2J.pgm"\nresolution: 0.05', "picture"),
    "yaml beyond unicode": ("a.yaml", 'image: "\\U00110000"\nresolution: 0.05', "a ROS map YAML"),
    "yaml no character": ("a.yaml", 'image: "\\UFFFFFFFF"\nresolution: 0.05', "YAML"),
    "yaml two": ("a.yaml", "a: 1\n---\na: 1", "2 documents"),
    "yaml thresholds": ("a.yaml", _map("free_thresh: 0.7"), "free_thresh <= occupied_thresh"),
    "yaml mode": ("a.yaml", _map("mode: grey"), "mode trinary, scale or raw"),
    "yaml negate": ("a.yaml", _map("negate: 2"), "negate 0 or 1"),
    "yaml image number": ("a.yaml", "image: 3\nresolution: 0.05", "name a picture, found 3"),
    "yaml image empty": ("a.yaml", "image: ''\nresolution: 0.05", "name a picture, found ''"),
    "yaml nan": ("a.yaml", "image: b.pgm\nresolution: .nan", "finite"),
    "yaml digits": ("a.yaml", "image: b.pgm\nresolution: " + "9" * 5000, "finite"),
    "yaml date": ("a.yaml", "image: b.pgm\nresolution: 2001-01-01", "resolution"),
    "extension": ("a.plan", "x", "ending in"),
}


def _refused(*arguments: object, **keywords: object) -> str:
    with pytest.raises(WorldError) as caught:
        load(*arguments, **keywords)  # type: ignore[arg-type]
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith("expected ")
    assert not re.search(r"['\"]expected ", text), "a message within another"
    assert "found" in text
    assert len(text) < 400
    return text


@pytest.mark.parametrize("case", BAD)
def test_bad_files_are_refused_in_one_line(tmp_path, case):
    name, content, words = BAD[case]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert words in _refused(tmp_path / name)


def test_what_is_no_file_is_refused(tmp_path):
    (tmp_path / "folder.json").mkdir()
    assert "directory" in _refused(tmp_path / "folder.json")
    assert "no such file" in _refused(tmp_path / "none.svg")
    for name in ("", "\0.json", "x" * 5000 + ".json", "nowhere"):
        _refused(name)


def test_links_that_lead_to_each_other_are_no_file(tmp_path):
    (tmp_path / "b.pgm").symlink_to("c.pgm")
    (tmp_path / "c.pgm").symlink_to("b.pgm")
    (tmp_path / "a.yaml").write_text("image: b.pgm\nresolution: 0.05")
    (tmp_path / "d.yaml").symlink_to("d.yaml")
    assert "found" in _refused(tmp_path / "a.yaml")
    assert "found" in _refused(tmp_path / "d.yaml")


def test_a_link_that_leads_out_of_the_folder_is_refused(tmp_path):
    (tmp_path / "home").mkdir()
    (tmp_path / "b.pgm").write_bytes(b"P5\n1 1\n255\n\0")
    (tmp_path / "home" / "b.pgm").symlink_to(tmp_path / "b.pgm")
    (tmp_path / "home" / "a.yaml").write_text("image: b.pgm\nresolution: 0.05")
    assert "folder" in _refused(tmp_path / "home" / "a.yaml")


def test_pictures_without_walls_or_without_room_are_refused(tmp_path):
    for grey, words in ((0, "found only dark or unknown pixels"), (255, "found no dark line")):
        Image.fromarray(np.full((100, 100), grey, dtype=np.uint8)).save(tmp_path / "flat.png")
        assert words in _refused(tmp_path / "flat.png")


def test_bad_starts_and_scales_are_refused(tmp_path):
    assert "start" in _refused("hall", start=(np.nan, 1.0))
    assert "start" in _refused("hall", start=(1.0,))
    assert "inside a wall" in _refused("hall", start=(7.9, 6.2))
    (tmp_path / "a.svg").write_text(f"<svg {NS}>{ROOM}</svg>")
    for scale in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(WorldError, match="scale"):
            DrawingOptions(scale=scale)


@pytest.mark.parametrize(
    ("name", "option"),
    [("a.yaml", "scale"), ("a.json", "level"), ("a.svg", "level"), ("a.geojson", "layers"), ("hall", "scale"),
     ("random:1", "without"), ("a.svg", "negate"), ("a.pgm", "ids"), ("a.dxf", "threshold")],
)  # fmt: skip
def test_an_option_is_refused_where_it_means_nothing(tmp_path, name, option):
    files = {
        "a.json": _plan(),
        "a.yaml": _map(""),
        "a.svg": _svg(""),
        "a.geojson": _feature(),
        "a.pgm": "",
        "a.dxf": "0",
    }
    value = {"scale": 0.1, "level": "1", "threshold": 0.5, "negate": True}.get(option, ("a",))
    if name in files:
        (tmp_path / name).write_text(files[name])
    told = _refused(tmp_path / name if name in files else name, options=DrawingOptions(**{option: value}))
    assert f"no --{option} for" in told


def test_a_picture_of_the_wrong_scale_is_refused(tmp_path):
    room = np.full((60, 60), 255, dtype=np.uint8)
    room[[5, 54]] = room[:, [5, 54]] = 0
    Image.fromarray(room).save(tmp_path / "a.png")
    assert "1000 m, found 3e+03 m" in _refused(tmp_path / "a.png", options=DrawingOptions(scale=50.0))


def test_outlines_that_cannot_be_mended_are_told(monkeypatch):
    def broken(*_: object) -> World:
        raise GEOSException("TopologyException: found non-noded intersection")

    monkeypatch.setattr(registry, "build", broken)
    assert "outlines that can be mended" in _refused("hall")


def test_geojson_of_more_pieces_than_can_be_read_soon_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(features, "PIECES_MAX", 4)
    (tmp_path / "a.geojson").write_text(_geo("LineString", [[0, 0], [6, 0], [6, 6], [0, 6], [0, 0]]))
    assert "coordinates to hold a list" in _refused(tmp_path / "a.geojson")


def test_a_start_given_by_the_caller_overrides_the_drawing():
    np.testing.assert_array_equal(load("hall", start=(2.0, 2.0, 1.0)).start, [2, 2, 1])
