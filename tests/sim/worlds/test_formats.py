"""One building in every format: the same free space, however it is written."""

import json

import numpy as np
import pytest
import shapely
from PIL import Image, ImageDraw
from shapely.affinity import rotate

from chainslam.sim.worlds import DrawingOptions, World, load

WALLS = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0], [4, 0, 4, 2.5], [4, 3.6, 4, 6]]
BLOCK = [(5.5, 2), (6.5, 2), (6.5, 3), (5.5, 3)]
START = (1.0, 1.0)
SVG = 'xmlns="http://www.w3.org/2000/svg"'


def _lines(sign: float = -1.0) -> str:
    return "".join(f'<line x1="{a}" y1="{sign * b}" x2="{c}" y2="{sign * d}"/>' for a, b, c, d in WALLS)


def _block() -> str:
    points = " ".join(f"{x},{-y}" for x, y in BLOCK)
    return f'<polygon points="{points}" fill="black"/>'


STROKE = 'fill="none" stroke="black" stroke-width="0.1"'
MARK = f'<circle id="start" cx="{START[0]}" cy="{-START[1]}" r="0.1" fill="none" stroke="green"/>'
BODY = f"<g {STROKE}>{_lines()}</g>{_block()}{MARK}"


@pytest.fixture
def truth() -> shapely.Polygon:
    walls = shapely.union_all([shapely.LineString([w[:2], w[2:]]).buffer(0.05, cap_style="square") for w in WALLS])
    return shapely.box(0, 0, 8, 6).difference(walls).difference(shapely.Polygon(BLOCK))


def _same(world: World, truth: shapely.Polygon, tolerance_m2: float = 1e-6) -> None:
    assert world.free.symmetric_difference(truth).area < tolerance_m2


def _save(tmp_path, name: str, text: str) -> str:
    (tmp_path / name).write_text(text)
    return str(tmp_path / name)


def test_plan_json(tmp_path, truth):
    walls = WALLS + [[*a, *b] for a, b in zip(BLOCK, BLOCK[1:] + BLOCK[:1], strict=True)]
    thick = truth.difference(shapely.Polygon(BLOCK).buffer(0.05, join_style="mitre"))
    plan = {"walls": walls, "start": START, "labels": {"A": [2, 2]}}
    world = load(_save(tmp_path, "plan.json", json.dumps(plan)))
    _same(world, thick)
    assert world.labels == {"A": (2.0, 2.0)}
    np.testing.assert_array_equal(world.start, [1, 1, 0])


@pytest.mark.parametrize("name", ["map.json", "map.geojson"])
def test_geojson_is_told_by_its_content(tmp_path, truth, name):
    walls = [[[a, b], [c, d]] for a, b, c, d in WALLS]
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "MultiLineString", "coordinates": walls}},
        {"type": "Feature", "properties": None, "geometry": {"type": "Polygon", "coordinates": [[*BLOCK, BLOCK[0]]]}},
        {"type": "Feature", "id": "start", "geometry": {"type": "Point", "coordinates": START}},
        {"type": "Feature", "properties": {"name": "B"}, "geometry": {"type": "Point", "coordinates": [3, 3]}},
    ]
    world = load(_save(tmp_path, name, json.dumps({"type": "FeatureCollection", "features": features})))
    _same(world, truth)
    assert world.labels == {"B": (3.0, 3.0)}


def test_a_point_of_kind_start_is_the_start_and_one_that_says_nothing_is_told(tmp_path):
    walls = [[[a, b], [c, d]] for a, b, c, d in WALLS]
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "MultiLineString", "coordinates": walls}},
        {"type": "Feature", "properties": {"kind": "Start"}, "geometry": {"type": "Point", "coordinates": START}},
        {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [3, 3]}},
    ]
    world = load(_save(tmp_path, "map.geojson", json.dumps({"type": "FeatureCollection", "features": features})))
    assert tuple(world.start[:2]) == START
    assert "left out: 1 feature of kinds that are no walls" in world.reading.notes
    assert world.labels == {}


def test_a_collection_of_geometries_is_read_part_by_part(tmp_path, truth):
    lines = [{"type": "LineString", "coordinates": [[a, b], [c, d]]} for a, b, c, d in WALLS]
    block = {"type": "Polygon", "coordinates": [[*BLOCK, BLOCK[0]]]}
    _same(
        load(_save(tmp_path, "map.geojson", json.dumps({"type": "GeometryCollection", "geometries": [*lines, block]}))),
        truth,
    )


@pytest.mark.parametrize(
    ("head", "body"),
    [
        ('viewBox="-1 -7 10 8" data-metres-per-unit="1"', BODY),
        ('viewBox="-1 -7 10 8" width="1000" height="800"', BODY),
        ('viewBox="-1 -7 10 8" width="1000cm" height="800cm"', BODY),
        ('viewBox="-100 -700 1000 800" width="10000mm"', f'<g transform="scale(100)">{BODY}</g>'),
        (
            'viewBox="0 0 10 8" data-metres-per-unit="1"',
            f'<g transform="translate(1 7)"><g transform="rotate(30)"><g transform="rotate(-30)">{BODY}</g></g></g>',
        ),
        ('viewBox="-2 -14 20 16" data-metres-per-unit="0.5"', f'<g transform="matrix(2 0 0 2 0 0)">{BODY}</g>'),
        ('viewBox="-1 -7 10 8"', f'<defs><g id="all">{BODY}</g></defs><use href="#all"/>'),
        ('viewBox="-1 -7 10 8"', f'<svg x="-1" y="-7" viewBox="-1 -7 10 8">{BODY}</svg><text x="1" y="1">hall</text>'),
        ('viewBox="-1 -7 10 8"', f'<rect x="-1" y="-7" width="10" height="8" fill="white"/>{BODY}'),
    ],
    ids=["metres", "no unit", "cm", "mm scaled", "nested", "half", "use", "nested svg", "white page"],
)
def test_svg_variants_give_the_same_geometry(tmp_path, truth, head, body):
    world = load(_save(tmp_path, "map.svg", f"<svg {SVG} {head}>{body}</svg>"))
    x, y = world.start[:2] - START
    _same(world, shapely.affinity.translate(truth, x, y))


def test_a_rotated_svg_is_a_rotated_world(tmp_path, truth):
    svg = f'<svg {SVG} data-metres-per-unit="1"><g transform="rotate(-20)">{BODY}</g></svg>'
    _same(load(_save(tmp_path, "map.svg", svg)), rotate(truth, 20, origin=(0, 0)), 1e-4)


def test_outlines_that_cross_themselves_are_filled_as_a_browser_fills_them(tmp_path):
    room = '<rect x="0" y="0" width="10" height="10" fill="none" stroke="black"/>'
    bow = '<path d="M 3 3 L 7 7 H 3 L 7 3 Z" fill="black"/>'
    star = '<path d="M 2 2 H 8 V 8 H 2 Z M 4 4 H 6 V 6 H 4 Z" fill="black" fill-rule="{}"/>'
    areas = [
        load(_save(tmp_path, f"{i}.svg", f"<svg {SVG}>{room}{shape}</svg>"), start=(1.0, -1.0)).free.area
        for i, shape in enumerate((bow, star.format("nonzero"), star.format("evenodd")))
    ]
    np.testing.assert_allclose(areas, [9.9**2 - 8, 9.9**2 - 36, 9.9**2 - 36], atol=1e-3)


def test_curves_become_short_straight_faces(tmp_path):
    svg = f'<svg {SVG}><circle r="4" fill="none" stroke="black"/><circle r="1" cx="1" fill="black"/></svg>'
    world = load(_save(tmp_path, "round.svg", svg))
    assert world.free.area == pytest.approx(np.pi * (3.95**2 - 1), rel=0.02)
    assert 20 < len(world.faces) < 120


def _picture(scale: int, blur: bool = False, ink: int = 0, paper: int = 255, line: int = 0) -> Image.Image:
    over = 4 if blur else 1
    image = Image.new("L", (10 * scale * over, 8 * scale * over), paper)
    draw = ImageDraw.Draw(image)
    width = line * over if line else max(1, round(0.1 * scale * over))
    for a, b, c, d in WALLS:
        ends = [(over * scale * (1 + x), over * scale * (7 - y)) for x, y in ((a, b), (c, d))]
        draw.line(ends, fill=ink, width=width)
    draw.polygon([(over * scale * (1 + x), over * scale * (7 - y)) for x, y in BLOCK], fill=ink)
    return image.resize((10 * scale, 8 * scale), Image.Resampling.LANCZOS) if blur else image


@pytest.mark.parametrize("suffix", ["png", "pgm", "bmp", "jpg", "gif"])
@pytest.mark.parametrize("blur", [False, True], ids=["hard", "antialiased"])
def test_pictures(tmp_path, truth, suffix, blur):
    path = tmp_path / f"map.{suffix}"
    _picture(20, blur).save(path)
    world = load(path, start=(2.0, 2.0))
    assert world.free.area == pytest.approx(truth.area, rel=0.03)
    assert len(world.faces) <= 24
    assert world.face_rings.max() == 1


@pytest.mark.parametrize("blur", [False, True], ids=["hard", "antialiased"])
def test_lines_of_one_pixel_are_walls_and_a_white_margin_is_outside(tmp_path, blur):
    _picture(20, blur, line=1).save(tmp_path / "map.png")
    world = load(tmp_path / "map.png")
    assert world.free.area == pytest.approx(46, abs=1.2)


def test_noise_transparency_colour_and_scale(tmp_path, truth):
    noise = np.random.default_rng(1).normal(0, 12, (160, 200))
    noisy = np.clip(np.asarray(_picture(20, True, ink=30, paper=235)) + noise, 0, 255).astype(np.uint8)
    Image.fromarray(noisy).save(tmp_path / "noisy.png")
    assert load(tmp_path / "noisy.png", start=(2.0, 2.0)).free.area == pytest.approx(truth.area, rel=0.04)
    ink = 255 - np.asarray(_picture(20))
    Image.fromarray(np.stack([0 * ink, 0 * ink, 0 * ink, ink], axis=-1)).save(tmp_path / "clear.png")
    assert load(tmp_path / "clear.png", options=DrawingOptions(scale=0.1)).free.area == pytest.approx(
        4 * truth.area, rel=0.03
    )


def test_specks_are_dust_but_pillars_are_not(tmp_path, truth):
    image = _picture(20)
    image.putpixel((60, 60), 0)
    ImageDraw.Draw(image).rectangle((50, 80, 54, 84), fill=0)
    image.save(tmp_path / "dust.png")
    assert load(tmp_path / "dust.png").face_rings.max() == 2


def _ros(tmp_path, text: str) -> World:
    image = np.asarray(_picture(20, ink=0, paper=254)).copy()
    image[:15] = image[-15:] = image[:, :15] = image[:, -15:] = 205
    Image.fromarray(image).save(tmp_path / "map.pgm")
    return load(_save(tmp_path, "map.yaml", f"image: map.pgm\nresolution: 0.05\n{text}"))


def test_ros_map_with_an_origin_and_a_yaw(tmp_path, truth):
    plain = _ros(tmp_path, "origin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n")
    turned = _ros(tmp_path, "origin: [-3.0, 2.0, 0.5]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n")
    assert plain.free.area == pytest.approx(truth.area, rel=0.03)
    moved = shapely.affinity.translate(rotate(plain.free, 0.5, origin=(0, 0), use_radians=True), -3, 2)
    _same(turned, moved, 0.05)


def test_negated_ros_map_swaps_wall_and_free(tmp_path):
    image = 254 - np.asarray(_picture(20, ink=0, paper=254))
    Image.fromarray(image).save(tmp_path / "map.pgm")
    yaml = "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 1\noccupied_thresh: 0.65\nfree_thresh: 0.196"
    assert load(_save(tmp_path, "map.yaml", yaml)).free.area == pytest.approx(45.0, abs=2.0)
