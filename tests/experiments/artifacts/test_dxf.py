"""`map.dxf` as a CAD program reads it: the same walls as in `map.geojson`, in metres, on layers."""

import io

import numpy as np
import pytest
from ezdxf import recover, units

from chainslam.experiments.artifacts.maps.dxf import DIMENSIONS, NOTES, OPEN_ENDS, PATH, TENTATIVE, WALLS, map_dxf
from chainslam.viz.floor_plan import Dimension


def _read(content):
    drawing, found = recover.read(io.BytesIO(content))
    assert not found.has_errors
    return drawing


def _on(drawing, layer, kind):
    return list(drawing.modelspace().query(f'{kind}[layer=="{layer}"]'))


def _feature(kind, shape, coordinates, **properties):
    geometry = {"type": shape, "coordinates": coordinates}
    return {"properties": {"kind": kind} | properties, "geometry": geometry}


ROOM = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0 + 1e-7], [0.0, 3.0]]
FEATURES = [
    _feature("chain", "Polygon", [[*ROOM, ROOM[0]]], closed=True, room=True),
    _feature("chain", "LineString", [[5.0, 0.0], [6.0, 1.0 / 3.0], [7.0, 0.0]], closed=False),
    _feature("wall", "LineString", [[0.0, 0.0], [4.0, 0.0]], tentative=False),
    _feature("wall", "LineString", [[8.0, 0.0], [8.0, 1.5]], tentative=True),
    _feature("corner", "Point", [4.0, 0.0]),
    _feature("trajectory", "LineString", [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]),
    _feature("start", "Point", [1.0, 1.0]),
    _feature("open-end", "Point", [7.0, 0.0]),
]
TOLD = [
    Dimension(np.array([2.0, 0.0]), np.array([4.0, 0.0]), "4.000 ± 0.002", "a wall"),
    Dimension(np.array([0.0, 1.5]), np.array([0.0, 0.001]), "0.001 ± 0.002", "no room for letters"),
]


@pytest.fixture(scope="module")
def drawing():
    return _read(map_dxf(FEATURES, TOLD, "a plan"))


def test_a_cad_program_finds_nothing_to_mend_and_reads_metres(drawing):
    assert not drawing.audit().errors
    assert drawing.units == units.M
    assert all(drawing.layers.has_entry(name) for name in (WALLS, TENTATIVE, DIMENSIONS, PATH, OPEN_ENDS, NOTES))


def test_a_chain_is_a_polyline_through_its_corners_closed_where_the_chain_is(drawing):
    found = {each.closed: np.array(list(each.get_points("xy"))) for each in _on(drawing, WALLS, "LWPOLYLINE")}
    np.testing.assert_allclose(found[True], ROOM, atol=1e-9)
    np.testing.assert_allclose(found[False], FEATURES[1]["geometry"]["coordinates"], atol=1e-9)


def test_walls_that_are_not_sure_stand_apart_and_no_wall_is_drawn_twice(drawing):
    (line,) = _on(drawing, TENTATIVE, "LINE")
    assert (line.dxf.start.xyz, line.dxf.end.xyz) == ((8.0, 0.0, 0.0), (8.0, 1.5, 0.0))
    assert len(_on(drawing, WALLS, "*")) == 2


def test_the_way_the_start_and_the_open_ends_are_drawn(drawing):
    (way,) = _on(drawing, PATH, "LWPOLYLINE")
    assert not way.closed
    assert len(way) == 3
    (start,), (end,) = _on(drawing, PATH, "CIRCLE"), _on(drawing, OPEN_ENDS, "CIRCLE")
    assert (start.dxf.center.xyz, end.dxf.center.xyz) == ((1.0, 1.0, 0.0), (7.0, 0.0, 0.0))


def test_a_length_stands_on_the_free_side_and_one_without_room_is_left_out(drawing):
    (text,) = _on(drawing, DIMENSIONS, "TEXT")
    assert text.dxf.text == "4.000 ± 0.002"
    middle = text.get_placement()[1]
    assert middle.x == pytest.approx(2.0)
    assert 0.0 < middle.y < 0.5


def test_the_same_map_gives_the_same_bytes():
    assert map_dxf(FEATURES, TOLD, "a plan") == map_dxf(FEATURES, TOLD, "a plan")


def test_a_line_break_in_a_name_ends_no_line_of_the_file_and_any_letters_stand():
    read = _read(map_dxf([], [], "間取り\n0\nEOF\n"))
    assert [each.dxf.text for each in _on(read, NOTES, "TEXT")] == ["間取り 0 EOF "]


def test_a_shape_with_a_coordinate_that_is_no_number_is_left_out():
    broken = _feature("wall", "LineString", [[0.0, 0.0], [np.nan, 1.0]], tentative=True)
    read = _read(map_dxf([broken], [], "a plan"))
    assert _on(read, TENTATIVE, "LINE") == []
    assert np.all(np.isfinite([*read.header["$EXTMIN"], *read.header["$EXTMAX"]]))
