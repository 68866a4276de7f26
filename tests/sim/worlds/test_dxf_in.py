"""DXF files as people have them: any unit, blocks, layers, and what is no wall."""

import ezdxf
import pytest
from ezdxf import units

from chainslam.sim.worlds import DrawingOptions, World, WorldError, load
from chainslam.sim.worlds.readers.foreign import FORMATS

UNITS = {
    "metres": (units.M, 1.0), "millimetres": (units.MM, 1e3), "centimetres": (units.CM, 1e2),
    "inches": (units.IN, 1 / 0.0254), "feet": (units.FT, 1 / 0.3048), "kilometres": (units.KM, 1e-3),
    "none": (0, 1.0),
}  # fmt: skip
AREA = 7.9 * 5.9 - 0.1 * (5.9 - 1.0)
"""Of a room with a wall across it that has a door of 1 m, m2."""


def _save(tmp_path, unit=units.M, size=1.0, version="R2010", more=None) -> World:
    document = ezdxf.new(version)
    if version != "R12":
        document.units = unit
    space = document.modelspace()
    corners = [(0, 0), (8 * size, 0), (8 * size, 6 * size), (0, 6 * size)]
    add = space.add_polyline2d if version == "R12" else space.add_lwpolyline
    add(corners, close=True, dxfattribs={"layer": "A-WALL"})
    for ends in ((0, 2.45), (3.55, 6)):
        space.add_line(*[(4 * size, y * size) for y in ends], dxfattribs={"layer": "A-WALL"})
    space.add_circle((2 * size, 2 * size), 0.1 * size, dxfattribs={"layer": "Start"})
    if more is not None:
        more(document, space)
    document.saveas(tmp_path / "a.dxf")
    return load(tmp_path / "a.dxf")


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("version", ["R2000", "R2010", "R2018"])
def test_any_unit_of_length_is_read(tmp_path, unit, version):
    world = _save(tmp_path, *UNITS[unit], version)
    assert world.free.area == pytest.approx(AREA, abs=1e-3)
    assert world.start[:2] == pytest.approx([2, 2], abs=1e-5)


def test_a_file_of_the_oldest_version_is_read_and_one_without_a_unit_that_is_no_building_refused(tmp_path):
    assert _save(tmp_path, version="R12").free.area == pytest.approx(AREA, abs=1e-3)
    with pytest.raises(WorldError, match=r"\$INSUNITS.*--scale"):
        _save(tmp_path, 0, 1000.0)
    assert load(tmp_path / "a.dxf", options=DrawingOptions(scale=0.001)).free.area == pytest.approx(AREA, abs=1e-3)


def _pillars(document, space):
    block = document.blocks.new("PILLAR")
    block.add_circle((0, 0), 0.25)
    outer = document.blocks.new("PAIR")
    outer.add_blockref("PILLAR", (0, 0))
    outer.add_blockref("PILLAR", (0, 2), dxfattribs={"xscale": 1.2, "yscale": 1.2})
    space.add_blockref("PAIR", (6, 2), dxfattribs={"layer": "S-COLS"})


def test_blocks_stand_where_they_are_inserted_on_the_layer_of_their_insertion(tmp_path):
    assert _save(tmp_path, more=_pillars).face_rings.max() == 2
    for said in ({"without": ("s-cols",)}, {"layers": ("A-*",)}, {"without": ("PAIR",)}):
        assert load(tmp_path / "a.dxf", options=DrawingOptions(**said)).face_rings.max() == 0
    with pytest.raises(WorldError, match=r"'A-WALL'.*found 'walls'"):
        load(tmp_path / "a.dxf", options=DrawingOptions(layers=("walls",)))


def _decoration(document, space):
    space.add_text("hall")
    space.add_mtext("hall")
    space.add_hatch().paths.add_polyline_path([(1, 1), (3, 1), (3, 3)])
    space.add_linear_dim(base=(0, 7), p1=(0, 0), p2=(8, 0)).render()
    document.layers.add("OFF").off()
    document.layers.add("COLD").freeze()
    for layer in ("OFF", "COLD"):
        space.add_line((0, 1), (8, 1), dxfattribs={"layer": layer})


def test_what_is_no_wall_is_left_out_and_told(tmp_path):
    world = _save(tmp_path, more=_decoration)
    assert world.free.area == pytest.approx(AREA, abs=1e-3)
    (told,) = [note for note in world.reading.notes if note.startswith("left out")]
    assert all(word in told for word in ("1 DIMENSION", "1 HATCH", "1 MTEXT", "1 TEXT"))


def _curves(document, space):
    space.add_arc((6, 3), 0.5, 0, 359.9)
    space.add_ellipse((2, 4), (0.5, 0), 0.5)
    space.add_spline([(5, 5), (5.5, 5.5), (6, 5), (5, 5)])
    space.add_solid([(1, 0.5), (1.5, 0.5), (1, 1), (1.5, 1)])


def test_curves_and_faces_are_walls(tmp_path):
    world = _save(tmp_path, more=_curves)
    assert world.face_rings.max() == 4
    assert "1 face as solid" in world.reading.understood


def _loop(document, space):
    block = document.blocks.new("A")
    block.add_blockref("A", (1, 0))
    space.add_blockref("A", (0, 0))


def _many(document, space):
    block = document.blocks.new("B0")
    block.add_line((0, 0), (1, 0))
    for depth in range(1, 12):
        outer = document.blocks.new(f"B{depth}")
        for _ in range(10):
            outer.add_blockref(f"B{depth - 1}", (0, 0))
    space.add_blockref("B11", (0, 0))


@pytest.mark.parametrize("more", [_loop, _many], ids=["loop", "many"])
def test_blocks_without_end_are_refused(tmp_path, more, monkeypatch):
    monkeypatch.setattr("chainslam.sim.worlds.readers.dxf.ENTITIES_MAX", 2000)
    with pytest.raises(WorldError, match="blocks"):
        _save(tmp_path, more=more)


@pytest.mark.parametrize("content", [b"", b"hello", b"AutoCAD Binary DXF\r\n\x1a\x00", b"  0\nSECTION\n", bytes(200)])
def test_what_is_no_dxf_is_refused(tmp_path, content):
    (tmp_path / "a.dxf").write_bytes(content)
    with pytest.raises(WorldError, match=r"expected .*found"):
        load(tmp_path / "a.dxf")


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_foreign_format_is_answered_by_its_name_and_the_way_in(tmp_path, suffix):
    (tmp_path / f"a{suffix}").write_text("x")
    with pytest.raises(WorldError, match=r"found (an? |points)") as caught:
        load(tmp_path / f"a{suffix}")
    assert FORMATS[suffix][1] in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.world", '<?xml version="1.0"?><sdf/>', "Gazebo"),
        ("b.world", 'floorplan ( bitmap "cave.png" )', "Stage"),
        ("c.yaml", "world:\n  height: 10\nrobot:\n  - {kinematics: {name: diff}}\n", "IR-SIM"),
        ("d.yml", "obstacle:\n- {shape: {a: {b: {c: {d: 1}}}}}\nworld: {width: 3}\n", "IR-SIM"),
    ],
)
def test_worlds_of_simulators_are_known_by_what_they_hold(tmp_path, name, content, words):
    (tmp_path / name).write_text(content)
    with pytest.raises(WorldError, match=words):
        load(tmp_path / name)
