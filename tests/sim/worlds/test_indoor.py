"""GeoJSON of indoor tools: storeys, doors apart from their walls, reference systems and units."""

import json

import numpy as np
import pytest

from chainslam.sim.worlds import DrawingOptions, World, WorldError, load

EAST_M, NORTH_M = 75_000.0, 111_200.0
"""A degree at latitude 47.6, roughly."""


def _box(x0, y0, x1, y1):
    return [[[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]]


def _feature(shape, coordinates, /, **properties):
    more = {"feature_type": properties.pop("feature_type")} if "feature_type" in properties else {}
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": shape, "coordinates": coordinates},
        **more,
    }


def _load(tmp_path, features, crs=None, **said) -> World:
    document = {"type": "FeatureCollection", "features": features} | ({"crs": crs} if crs else {})
    (tmp_path / "a.geojson").write_text(json.dumps(document))
    return load(tmp_path / "a.geojson", options=DrawingOptions(**said))


def _crs(name):
    return {"type": "name", "properties": {"name": name}}


LEFT, RIGHT = _box(0, 0, 5, 4), _box(5, 0, 10, 4)


@pytest.mark.parametrize(
    "door",
    [
        _feature("LineString", [[5, 1], [5, 2]], kind="door"),
        _feature("LineString", [[5, 1], [5, 2]], indoor="door", level="0"),
        _feature("Point", [5, 1.5], door="yes", width=1.0),
        _feature("Point", [5.1, 1.5], kind="Entrance", width=1.0),
        _feature("LineString", [[5, 1], [5, 2]], category="pedestrian", feature_type="opening"),
    ],
    ids=["line", "osm line", "node", "entrance", "imdf"],
)
def test_rooms_that_share_a_wall_are_joined_by_the_door_that_is_drawn_on_it(tmp_path, door):
    rooms = [_feature("Polygon", ring, indoor="room", level="0") for ring in (LEFT, RIGHT)]
    world = _load(tmp_path, [*rooms, door])
    assert world.free.area == pytest.approx(40 - 0.1 * 4 + 0.1 * 1, abs=1e-3)
    shut = _load(tmp_path, rooms)
    assert shut.free.area == pytest.approx(20 - 0.05 * 4, abs=1e-3)


def test_a_door_that_leads_out_stays_shut(tmp_path):
    room = _feature("Polygon", LEFT, kind="room")
    for door in ([[0, 1], [0, 2]], [[-0.1, 1], [-0.1, 2]], [[1, 4], [2, 4]]):
        assert _load(tmp_path, [room, _feature("LineString", door, kind="door")]).free.area == pytest.approx(20)


def test_a_door_in_a_wall_of_lines_is_cut_out(tmp_path):
    walls = [[[0, 0], [10, 0], [10, 4], [0, 4], [0, 0]], [[5, 0], [5, 4]]]
    lines = [_feature("LineString", wall, kind="wall") for wall in walls]
    world = _load(tmp_path, [*lines, _feature("LineString", [[5, 1], [5, 2]], kind="opening")])
    assert world.free.area == pytest.approx(9.9 * 3.9 - 0.1 * 2.9, abs=1e-6)


def test_an_outline_of_a_storey_is_a_room_only_where_nothing_else_is_drawn(tmp_path):
    outline = _feature("Polygon", _box(-1, -1, 11, 5), indoor="level", level="0")
    room = _feature("Polygon", LEFT, indoor="room", level="0")
    assert _load(tmp_path, [outline, room]).free.area == pytest.approx(20)
    assert _load(tmp_path, [outline]).free.area == pytest.approx(72)


@pytest.mark.parametrize("key", ["level", "storey", "floor", "story"])
def test_one_storey_is_read_and_told_and_never_two(tmp_path, key):
    sizes = {"-1": 3, "0": 4, "1": 5, 2: 6}
    rooms = [_feature("Polygon", _box(0, 0, n, n), kind="room", **{key: level}) for level, n in sizes.items()]
    stairs = _feature("Polygon", _box(0.5, 0.5, 1, 1), kind="solid", **{key: "0-2"})
    world = _load(tmp_path, [*rooms, stairs])
    assert world.free.area == pytest.approx(16 - 0.25)
    assert any("storey '0' of '-1', '0', '1', '2'" in note for note in world.reading.notes)
    for level, n in sizes.items():
        there = _load(tmp_path, [*rooms, stairs], level=str(level)).free.area
        assert there == pytest.approx(n * n - (0.25 if level != "-1" else 0))
    with pytest.raises(WorldError, match=r"--level of the file .* found '7'"):
        _load(tmp_path, rooms, level="7")


def test_storeys_of_imdf_are_known_by_their_ordinal(tmp_path):
    levels = [
        {"id": f"u{n}", **_feature("Polygon", _box(-9, -9, 9, 9), ordinal=n, feature_type="level")} for n in (0, 1)
    ]
    units = [
        _feature("Polygon", _box(0, 0, 4 + n, 4), category="room", level_id=f"u{n}", feature_type="unit")
        for n in (0, 1)
    ]
    assert _load(tmp_path, [*levels, *units], level="1").free.area == pytest.approx(20)


UNITS = {"millimetres": 0.001, "centimetres": 0.01, "inches": 0.0254, "feet": 0.3048, "yards": 0.9144, "metres": 1.0}


@pytest.mark.parametrize("unit", UNITS)
def test_any_unit_can_be_stated(tmp_path, unit):
    metres = UNITS[unit]
    ring = (np.array(_box(0, 0, 12, 9)) / metres).tolist()
    start = _feature("Point", [2 / metres, 3 / metres], name="START", heading=0.5)
    world = _load(tmp_path, [_feature("Polygon", ring, kind="room"), start], scale=metres)
    assert world.free.area == pytest.approx(108)
    np.testing.assert_allclose(world.start, [2, 3, 0.5])
    plan = {"walls": (np.array([[0, 0, 9, 0], [9, 0, 9, 9], [9, 9, 0, 9], [0, 9, 0, 0]]) / metres).tolist()}
    (tmp_path / "p.json").write_text(json.dumps(plan))
    assert load(tmp_path / "p.json", options=DrawingOptions(scale=metres)).free.area == pytest.approx(8.9**2)


def _degrees(lon, lat):
    ring = np.array(_box(0, 0, 12, 9)) / [EAST_M, NORTH_M] + [lon, lat]
    return _feature("Polygon", ring.tolist(), kind="room")


@pytest.mark.parametrize("crs", [None, _crs("urn:ogc:def:crs:OGC:1.3:CRS84"), _crs("EPSG:4326"), _crs("EPSG::4258")])
def test_degrees_are_laid_flat_in_metres(tmp_path, crs):
    world = _load(tmp_path, [_degrees(8.5, 47.6)], crs)
    x0, y0, x1, y1 = world.free.bounds
    # The figures of a degree above are rounded to 0.5 %.
    assert (x1 - x0, y1 - y0) == (pytest.approx(12, rel=0.005), pytest.approx(9, rel=0.005))
    assert "degrees" in world.reading.scale


@pytest.mark.parametrize("latitude", [0.0, 30.0, 49.0, -60.0])
def test_web_mercator_is_shrunk_to_its_true_size(tmp_path, latitude):
    radius = 6378137.0
    grown = 1 / np.cos(np.deg2rad(latitude))
    y = radius * np.log(np.tan(np.pi / 4 + np.deg2rad(latitude) / 2))
    ring = (np.array(_box(0, 0, 12, 9)) * grown + [966_000, y]).tolist()
    world = _load(tmp_path, [_feature("Polygon", ring, kind="room")], _crs("urn:ogc:def:crs:EPSG::3857"))
    assert world.free.area == pytest.approx(108, rel=1e-5)


@pytest.mark.parametrize("name", ["EPSG:2263", "urn:ogc:def:crs:EPSG::2229", "urn:ogc:def:crs:EPSG::6543", "my feet"])
def test_a_reference_system_of_another_unit_is_refused_unless_it_is_stated(tmp_path, name):
    room = _feature("Polygon", _box(0, 0, 30, 30), kind="room")
    with pytest.raises(WorldError, match=r"reference system .*--scale 0.3048 for feet"):
        _load(tmp_path, [room], _crs(name))
    assert _load(tmp_path, [room], _crs(name), scale=0.3048).free.area == pytest.approx((30 * 0.3048) ** 2)


@pytest.mark.parametrize("name", ["urn:ogc:def:crs:EPSG::32632", "EPSG:25832", "EPSG:2056", "local metres"])
def test_projections_in_metres_are_read_as_they_stand(tmp_path, name):
    world = _load(tmp_path, [_feature("Polygon", _box(5e5, 4e6, 5e5 + 6, 4e6 + 5), kind="room")], _crs(name))
    assert world.free.area == pytest.approx(30)


def test_lines_of_other_kinds_are_no_walls(tmp_path):
    room = _feature("Polygon", LEFT, kind="room")
    way = _feature("LineString", [[0, 2], [5, 2]], kind="route")
    street = _feature("LineString", [[2, 0], [2, 4]], highway="footway")
    world = _load(tmp_path, [room, way, street])
    assert world.free.area == pytest.approx(20)
    assert any("2 features" in note for note in world.reading.notes)
