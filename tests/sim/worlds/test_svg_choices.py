"""What of an SVG file is wall: by layers and ids, by what lies on top, and by where its marks stand."""

import gzip

import numpy as np
import pytest
import shapely

from chainslam.sim.worlds import DrawingOptions, World, WorldError, load
from chainslam.sim.worlds.readers.svg.reader import read_svg
from chainslam.sim.worlds.solid import solid_of
from tests.fuzzing.drawn_svg import UNKNOWN

INKSCAPE = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
HEAD = f'<svg xmlns="http://www.w3.org/2000/svg" {INKSCAPE} viewBox="0 0 10 8">'
ROOM = '<rect x="1" y="1" width="8" height="6" fill="none" stroke="black" stroke-width="0.1"/>'
BLANK = '<rect x="2" y="2" width="2" height="2" fill="#fff"'
PARTS = (
    '<g inkscape:label="Furniture" class="movable"><rect x="2" y="2" width="1" height="1"/></g>'
    '<g id="dimensions"><path d="M1 4H9" stroke="black" fill="none"/></g><circle id="pillar" cx="7" cy="3" r=".3"/>'
)


def _load(tmp_path, body: str, **said: object) -> World:
    (tmp_path / "a.svg").write_text(f"{HEAD}{ROOM}{body}</svg>")
    return load(tmp_path / "a.svg", options=DrawingOptions(**said))


@pytest.mark.parametrize(
    ("said", "rings", "area"),
    [
        ({"without": ("dimensions",)}, 3, 46.61 - 1 - 0.28),
        ({"without": ("DIM*", "movable", "pillar")}, 1, 46.61),
        ({"without": ("dimensions", "furniture")}, 2, 46.61 - 0.28),
        ({"layers": ("furniture",), "ids": ("pillar",)}, 0, 0),
    ],
)
def test_layers_and_ids_choose_what_is_wall(tmp_path, said, rings, area):
    if not rings:
        with pytest.raises(WorldError, match="enclose"):
            _load(tmp_path, PARTS, **said)
        return
    world = _load(tmp_path, PARTS, **said)
    assert world.face_rings.max() + 1 == rings
    assert world.free.area == pytest.approx(area, abs=0.01)


def test_a_name_that_no_part_has_is_told_with_those_there_are(tmp_path):
    with pytest.raises(WorldError, match=r"'Furniture', 'dimensions', 'movable'.*found 'walls'"):
        _load(tmp_path, PARTS, layers=("walls",))
    assert not any("--layers" in note for note in _load(tmp_path, PARTS, without=("dimensions",)).reading.notes)
    assert any("--layers" in note for note in _load(tmp_path, PARTS).reading.notes)


@pytest.mark.parametrize("paint", UNKNOWN)
def test_a_paint_that_is_not_understood_leaves_the_one_below_and_is_named(tmp_path, paint):
    world = _load(tmp_path, f'<style>:root{{--white:#fff}}</style>{BLANK} style="fill:{paint}"/>')
    assert world.face_rings.max() == 0
    if paint in ("blak", "#12", "rgb(1,2)", "device-cmyk(0 0 0 1)", "icc(1)", "12"):
        assert any(f"fill {paint}" in note for note in world.reading.notes)


@pytest.mark.parametrize(
    "door",
    [
        '<rect x="4.9" y="3" width=".2" height="1" fill="white"/>',
        '<path d="M5 3V4" stroke="white" stroke-width=".3"/>',
        '<g opacity=".99"><rect x="4" y="3" width="2" height="1" fill="#fefefe"/></g>',
        '<use href="#leaf" x="4.9" y="3"/>',
    ],
)
def test_a_door_that_is_painted_white_is_as_wide_as_it_is_painted(tmp_path, door):
    leaf = '<defs><rect id="leaf" width=".2" height="1" fill="white"/></defs>'
    world = _load(tmp_path, f'{leaf}<path d="M5 1V7" stroke="black" stroke-width=".1"/>{door}')
    inner = np.unique(np.round(world.faces[np.all(np.abs(world.faces[:, :, 0] - 5) < 0.06, axis=1)][..., 1], 3))
    assert {4.0, 5.0} <= set(inner.tolist())
    assert world.free.area == pytest.approx(46.61 - 4.9 * 0.1, abs=1e-3)


def test_a_wall_that_is_painted_again_over_a_door_is_shut(tmp_path):
    wall = '<path d="M5 1V7" stroke="black" stroke-width=".1"/>'
    world = _load(tmp_path, f'{wall}<path d="M5 3V4" stroke="white" stroke-width=".3"/>{wall}')
    assert world.free.area < 24


def test_a_room_that_is_painted_up_to_the_middle_of_its_wall_leaves_the_wall(tmp_path):
    wall = '<path d="M5 1V7" stroke="black" stroke-width=".1"/>'
    one = _load(tmp_path, f'{wall}<rect x="1" y="1" width="4" height="6" fill="ivory"/>')
    assert one.free.area < 24
    both = _load(tmp_path, f'{wall}<rect x="2" y="2" width="6" height="4" fill="ivory"/>')
    assert both.free.area > 46


@pytest.mark.parametrize(
    "mark",
    [
        '<g id="start"><circle cx="3" cy="3" r=".2"/></g>',
        '<g inkscape:label="Start" transform="translate(1 1)"><path d="M1 2h2M2 1v2"/></g>',
        '<use id="start" href="#p" x="3" y="3"/>',
        '<text id="start" x="3" y="3">S</text>',
        '<g opacity="0"><circle id="start" cx="3" cy="3" r=".2"/></g>',
        '<svg id="START" x="2" y="2" width="2" height="2" viewBox="0 0 1 1"><rect width="1" height="1"/></svg>',
    ],
)
def test_a_start_may_be_a_group_a_copy_or_a_word_and_is_no_pillar(tmp_path, mark):
    defs = '<defs><circle id="p" r=".2"/></defs>'
    world = _load(tmp_path, defs + mark)
    np.testing.assert_allclose(world.start[:2], [3, 5], atol=1e-9)
    assert world.face_rings.max() == 0


def test_what_lies_beyond_the_page_is_told_and_most_of_it_refused(tmp_path):
    world = _load(tmp_path, '<rect x="11" y="2" width="2" height="2" fill="black"/>')
    assert any("outside the page" in note for note in world.reading.notes)
    (tmp_path / "b.svg").write_text(f'{HEAD}<g transform="translate(8 0)">{ROOM}</g></svg>')
    with pytest.raises(WorldError, match="% of its walls outside the viewBox"):
        load(tmp_path / "b.svg")


def test_a_compressed_file_is_read_and_a_cut_one_refused(tmp_path):
    data = gzip.compress(f"{HEAD}{ROOM}</svg>".encode())
    (tmp_path / "a.svgz").write_bytes(data)
    assert load(tmp_path / "a.svgz").free.area == pytest.approx(46.61)
    (tmp_path / "a.svgz").write_bytes(data[:-20])
    with pytest.raises(WorldError, match=r"found one that ends early|broken XML"):
        load(tmp_path / "a.svgz")
    (tmp_path / "a.svgz").write_bytes(gzip.compress(bytes(70 * 2**20)))
    with pytest.raises(WorldError, match="64 MB"):
        load(tmp_path / "a.svgz")


def _is_wall_in_the_middle(body: str) -> bool:
    return bool(shapely.intersects_xy(solid_of(read_svg(f"{HEAD}{ROOM}{body}</svg>".encode())), 5.0, 4.0))


@pytest.mark.parametrize("broad_m", [0.1, 0.2])
@pytest.mark.parametrize(("share", "stands"), [(0.65, True), (0.75, False)])
def test_a_stroke_of_which_more_than_seven_tenths_are_hidden_is_no_wall(broad_m, share, stands):
    """One side of its width, from end to end."""
    stroke = f'<path d="M2 4H8" stroke="black" stroke-width="{broad_m}"/>'
    hiding = f'<rect x="1.5" y="{4 - broad_m / 2}" width="7" height="{share * broad_m}" fill="white"/>'
    assert _is_wall_in_the_middle(stroke + hiding) == stands


@pytest.mark.parametrize(("grey", "stands"), [("#404040", True), ("#a8a8a8", True), ("#bcbcbc", False)])
def test_what_is_darker_than_seven_tenths_of_white_is_wall(grey, stands):
    """A grey of 168 of 255 is, one of 188 is not."""
    assert _is_wall_in_the_middle(f'<rect x="4" y="3" width="2" height="2" fill="{grey}"/>') == stands
