"""However large the input, the answer is a world or one line, soon and without filling the memory."""

import json
from itertools import pairwise

import numpy as np
import pytest
import shapely
from PIL import Image

from chainslam.sim.worlds import WorldError, limits, load
from chainslam.sim.worlds.drawing import Drawing
from chainslam.sim.worlds.solid import solid_of

SVG = '<svg xmlns="http://www.w3.org/2000/svg" data-metres-per-unit="1">'
ROOM = '<rect width="90" height="90" fill="none" stroke="black"/>'
ARCS = " ".join(f"M{i % 80} {i // 80} a1 1 0 0 1 1 1" for i in range(2000))
GRID = np.add.outer(np.arange(1024), np.arange(1024))
RANDOM = np.random.default_rng(1)
CROSSING = [[0, float(y), 9, float(z)] for y, z in RANDOM.uniform(0, 9, (700, 2))]


def square(x: float, y: float) -> list[list[float]]:
    """Return a ring of half a metre."""
    return [[x, y], [x + 0.5, y], [x + 0.5, y + 0.5], [x, y + 0.5], [x, y]]


LARGE = {
    "checkerboard": ("a.png", GRID % 2 == 0, "sides of pixels"),
    "noise": ("a.png", RANDOM.random((1100, 1100)) < 0.5, "sides of pixels"),
    "arcs": ("a.svg", f'{SVG}{ROOM}<path fill="none" stroke="black" d="{ARCS}"/></svg>', "straight pieces"),
    "style": ("a.svg", f'{SVG}{ROOM}<path style="{"x" * 100_000}" d="M1 1h5v5"/></svg>', "10000 characters"),
    "style sheet": ("a.svg", f"{SVG}{ROOM}<style>{'a' * 300_000}</style></svg>", "200000 in a <style>"),
    "transform": ("a.svg", f'{SVG}<g transform="{"rotate(1 " * 9000}">{ROOM}</g></svg>', "10000 characters"),
    "polygon": ("a.svg", f'{SVG}{ROOM}<polygon points="{"1 2 3 1 " * 20_000}"/></svg>', "straight pieces"),
    "decoration": (
        "a.svg",
        f'{SVG}{ROOM}<polygon fill="none" stroke="#eee" points="{"1 2 3 1 " * 10_500}"/></svg>',
        "straight pieces",
    ),
    "walls": ("a.json", json.dumps({"walls": [[0, 0, 9, 0]] * 100_000}), "straight pieces"),
    "walls without length": (
        "a.json",
        json.dumps({"walls": [[0, 0, 9, 0], *[[1, 1, 1, 1]] * 20_000]}),
        "straight pieces",
    ),
    "crossing walls": ("a.json", json.dumps({"walls": CROSSING}), "meet"),
    "ring": (
        "a.geojson",
        json.dumps({"type": "Polygon", "coordinates": [[[i % 7, i % 5] for i in range(30_000)]]}),
        "straight pieces",
    ),
    "far": ("a.geojson", json.dumps({"type": "LineString", "coordinates": [[0, 0], [1e300, 5]]}), "from the origin"),
    "islands": (
        "a.geojson",
        json.dumps({"type": "MultiPolygon", "coordinates": [[square(x, y)] for x in range(20) for y in range(20)]}),
        "say what they are",
    ),
    "yaml": ("a.yaml", "a: " + "x" * 70_000, "65536 bytes"),
    "yaml deep": ("a.yaml", "a: " + "[" * 30_000, "deep"),
    "yaml wide": ("a.yaml", "\n".join(f"k{i}: {i}" for i in range(5000)), "image"),
}


@pytest.mark.parametrize("case", LARGE)
def test_what_is_too_large_is_told_in_one_line(tmp_path, case):
    name, content, words = LARGE[case]
    if isinstance(content, np.ndarray):
        Image.fromarray(np.where(content, 0, 255).astype(np.uint8)).save(tmp_path / name)
    else:
        (tmp_path / name).write_text(content)
    with pytest.raises(WorldError) as caught:
        load(tmp_path / name)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "'expected" not in str(caught.value)


ROUND = [[0, 0, 9, 0], [9, 0, 9, 9], [9, 9, 0, 9], [0, 9, 0, 0]]
CROSSED = [[0, 4 + 0.01 * k, 9, 5 - 0.01 * k - 0.002 * k**2] for k in range(12)]
"""Each crosses each: only the pieces between the crossings lie side by side."""
ZIGZAG = [(0.2 * k, 4.0 + 0.05 * (k % 2)) for k in range(46)]
SLIT = [[*a, *b] for up in (0.0, 0.11) for a, b in pairwise([(x, y + up) for x, y in ZIGZAG])]
"""Two walls as far apart that a slit of a centimetre is left between them."""


@pytest.mark.parametrize("walls", [CROSSED, SLIT], ids=["crossed", "slit"])
def test_pieces_that_come_of_a_drawing_are_counted_like_those_in_it(tmp_path, monkeypatch, walls):
    (tmp_path / "a.json").write_text(json.dumps({"walls": ROUND + walls}))
    load(tmp_path / "a.json")
    monkeypatch.setattr(limits, "CLOSE_MAX", 30)
    with pytest.raises(WorldError, match="more than 30 pairs nearer than"):
        load(tmp_path / "a.json")


def test_pieces_of_lines_that_cross_are_counted_before_the_walls_are_made_thick(monkeypatch):
    lines = tuple(shapely.LineString([wall[:2], wall[2:]]) for wall in CROSSED)
    limits.check_apart(lines, limits.CLOSE_M)
    monkeypatch.setattr(limits, "CLOSE_MAX", 5)
    limits.check_apart(lines, limits.CLOSE_M)
    with pytest.raises(WorldError, match="more than 5 pairs nearer than"):
        solid_of(Drawing(lines))


def test_lines_side_by_side_are_told_before_they_are_put_together(monkeypatch):
    monkeypatch.setattr(limits, "CLOSE_MAX", 5)
    lines = [shapely.LineString([(0, 0.05 * k), (9, 0.05 * k)]) for k in range(4)]
    with pytest.raises(WorldError, match="more than 5 pairs nearer than"):
        limits.check_size(lines, ())


def test_a_drawing_that_is_far_too_small_is_told_by_its_size_and_not_by_how_near_its_walls_are(monkeypatch):
    monkeypatch.setattr(limits, "CLOSE_MAX", 5)
    lines = [shapely.LineString([(0, 0.005 * k), (0.09, 0.005 * k)]) for k in range(9)]
    with pytest.raises(WorldError, match="a building of 1 to 1000 m"):
        limits.check_size(lines, ())


def storey(rooms: int) -> dict[str, object]:
    """Return a plan of rooms in a square, a door in two walls of each and a short wall in its middle."""
    side = 4.0
    walls: list[list[float]] = []
    for i in range(rooms):
        for j in range(rooms):
            x, y = side * i, side * j
            walls += [[x, y, x + 1.5, y], [x + 2.5, y, x + side, y], [x, y, x, y + 1.5], [x, y + 2.5, x, y + side]]
            walls += [[x + 1, y + 1, x + 1.5, y + 1.2]]
    end = side * rooms
    return {"walls": [*walls, [0, 0, end, 0], [end, 0, end, end], [end, end, 0, end], [0, end, 0, 0]]}


@pytest.mark.parametrize("rooms", [6, pytest.param(45, marks=pytest.mark.long)])
def test_a_plan_of_many_walls_is_a_world(tmp_path, rooms):
    (tmp_path / "a.json").write_text(json.dumps(storey(rooms)))
    world = load(tmp_path / "a.json")
    assert world.free.area > 0.85 * (4 * rooms) ** 2
    assert world.face_rings.max() > rooms**2


def test_what_lies_about_the_floor_of_a_robots_map_is_solid(tmp_path):
    grey = np.full((1000, 1000), 205, dtype=np.uint8)
    grey[400:600, 300:600] = 0
    grey[402:598, 302:598] = 254
    Image.fromarray(grey).save(tmp_path / "a.png")
    np.testing.assert_allclose(load(tmp_path / "a.png").free.bounds, [15.1, 20.1, 29.9, 29.9], atol=1e-9)
