"""A building as GeoJSON, in every way to draw it: rooms as polygons, walls as polygons, walls as lines."""

import json

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from chainslam.sim.worlds import World, WorldError, load

QUICK = settings(
    max_examples=25, deadline=None, database=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
ROOM = shapely.box(0, 0, 9, 7)
HOLE = shapely.box(4, 3, 5, 4)


def feature(shape: shapely.Geometry, **properties: object) -> dict[str, object]:
    return {"type": "Feature", "properties": properties, "geometry": shapely.geometry.mapping(shape)}


def world_of(tmp_path, features: list[dict[str, object]], **members: object) -> World:
    path = tmp_path / "map.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features, **members}))
    return load(path)


def same(world: World, floor: shapely.Geometry, tolerance_m2: float = 1e-3) -> None:
    assert world.free.symmetric_difference(floor).area < tolerance_m2


def start(x: float, y: float) -> dict[str, object]:
    return feature(shapely.Point(x, y), name="start")


@st.composite
def floors(draw: st.DrawFn) -> shapely.Polygon:
    """Return a floor of overlapping boxes on a grid of 0.5 m, with pillars in it."""
    span = st.integers(4, 16)
    floor = shapely.box(0, 0, 0.5 * draw(span), 0.5 * draw(span))
    for _ in range(draw(st.integers(0, 4))):
        x, y = draw(st.integers(0, 14)), draw(st.integers(0, 14))
        floor = floor.union(shapely.box(0.5 * x, 0.5 * y, 0.5 * (x + draw(span)), 0.5 * (y + draw(span))))
    for _ in range(draw(st.integers(0, 3))):
        x, y = draw(st.integers(0, 40)), draw(st.integers(0, 40))
        floor = floor.difference(shapely.box(0.5 * x, 0.5 * y, 0.5 * x + 0.5, 0.5 * y + 0.5))
    assume(isinstance(floor, shapely.Polygon))
    # What touches itself in a point, or is no broader than a robot, is another floor in each way to draw it.
    inner = floor.buffer(-0.24, join_style="mitre")
    outer = floor.buffer(0.24, join_style="mitre")
    assume(isinstance(inner, shapely.Polygon))
    assume(isinstance(outer, shapely.Polygon))
    assume(len(inner.interiors) == len(floor.interiors) == len(outer.interiors))
    return floor


def ways(floor: shapely.Polygon) -> dict[str, list[dict[str, object]]]:
    """Return a floor in every way that people draw it."""
    outline = shapely.Polygon(floor.exterior)
    pillars = [shapely.Polygon(ring) for ring in floor.interiors]
    middle = [
        outline.buffer(0.05, join_style="mitre").exterior,
        *(pillar.buffer(-0.05, join_style="mitre").exterior for pillar in pillars),
    ]
    lines = [shapely.LineString(ring.coords) for ring in middle]
    shell = outline.buffer(0.3, join_style="mitre").difference(outline)
    return {
        "a polygon with holes": [feature(floor)],
        "a room that says so": [feature(floor, kind="room")],
        "a room and what stands in it": [feature(outline), *map(feature, pillars)],
        "said, both": [feature(outline, type="floor"), *(feature(pillar, type="column") for pillar in pillars)],
        "in pieces": [feature(shapely.MultiPolygon([floor]))],
        "thick walls": [feature(shell), *map(feature, pillars)],
        "thick walls that say so": [feature(shell, kind="wall"), *(feature(p, indoor="column") for p in pillars)],
        "lines": [feature(line) for line in lines],
        "lines around solid things": [feature(lines[0]), *map(feature, pillars)],
        "lines around a room": [feature(lines[0]), feature(floor, indoor="room")],
    }


@QUICK
@given(floor=floors())
def test_every_way_to_draw_a_floor_gives_the_same_floor(tmp_path, floor):
    at = shapely.get_coordinates(shapely.maximum_inscribed_circle(floor))[0]
    assume(floor.boundary.distance(shapely.Point(at)) > 0.45)
    for name, features in ways(floor).items():
        world = world_of(tmp_path, [*features, start(*at)])
        assert world.free.symmetric_difference(floor).area < 1e-3 + 0.06 * floor.length * (name == "lines"), name


def test_a_room_with_a_hole_is_a_room_and_says_so(tmp_path):
    world = world_of(tmp_path, [feature(ROOM.difference(HOLE))])
    same(world, ROOM.difference(HOLE))
    assert world.reading is not None
    assert "1 polygon as a room" in world.reading.understood
    assert "by their shape" in world.reading.understood
    assert "assumed" in world.reading.start


def test_a_door_drawn_as_a_polygon_is_counted_once(tmp_path):
    rooms = [feature(shapely.box(x, 0, x + 3, 3), kind="room") for x in (0, 3.1)]
    world = world_of(tmp_path, [*rooms, feature(shapely.box(2.9, 1, 3.2, 2), kind="door")])
    assert world.reading is not None
    assert world.reading.understood == "2 polygons as rooms, 1 door"


def test_what_the_file_says_goes_before_what_the_shape_suggests(tmp_path):
    broad = shapely.box(0, 0, 12, 12).difference(shapely.box(4, 4, 8, 8))
    same(world_of(tmp_path, [feature(broad)]), broad)
    world = world_of(tmp_path, [feature(broad, kind="wall")])
    same(world, shapely.box(4, 4, 8, 8))
    assert world.reading is not None
    assert world.reading.understood == "1 polygon as solid"


def test_a_courtyard_building_is_a_room_and_its_court_is_not(tmp_path):
    ring = shapely.box(0, 0, 24, 22).difference(shapely.box(2, 2, 22, 20))
    same(world_of(tmp_path, [feature(ring)]), ring)


def test_rooms_that_share_an_edge_are_open_to_each_other(tmp_path):
    rooms = [shapely.box(0, 0, 3, 3), shapely.box(3 + 1e-9, 1, 6, 3), shapely.box(3, 3, 4, 5)]
    same(world_of(tmp_path, [feature(room) for room in rooms]), shapely.union_all(rooms))


def test_rooms_apart_have_a_wall_between_them(tmp_path):
    rooms = [shapely.box(0, 0, 3, 3), shapely.box(3.3, 0, 9, 3)]
    same(world_of(tmp_path, [feature(room) for room in rooms]), rooms[1])
    same(world_of(tmp_path, [*(feature(room) for room in rooms), start(1, 1)]), rooms[0])


def test_walls_of_polygons_that_overlap_enclose_a_floor_with_things_in_it(tmp_path):
    walls = [shapely.box(0, 0, 9, 0.3), shapely.box(0, 6, 9, 6.3), shapely.box(0, 0, 0.3, 6.3)]
    walls += [shapely.box(8.7, 0, 9, 6.3)]
    table = shapely.box(3, 2, 6, 4)
    same(world_of(tmp_path, [feature(w) for w in (*walls, table)]), shapely.box(0.3, 0.3, 8.7, 6).difference(table))


def test_a_block_that_fills_a_hall_is_solid_but_one_that_leaves_no_floor_is_the_floor(tmp_path):
    hall = feature(shapely.LineString(ROOM.exterior.coords))
    inside = ROOM.buffer(-0.05, join_style="mitre")
    block = ROOM.buffer(-1.0, join_style="mitre")
    same(world_of(tmp_path, [hall, feature(block)]), inside.difference(block))
    same(world_of(tmp_path, [hall, feature(ROOM.difference(HOLE))]), inside.difference(HOLE))


def test_a_room_built_onto_a_house_drawn_in_lines_is_a_room(tmp_path):
    house = feature(shapely.LineString(shapely.box(0, 0, 9, 7).exterior.coords))
    annex = shapely.box(9.05, 0, 14, 7)
    same(world_of(tmp_path, [house, feature(annex), start(12, 3)]), annex)


def test_doors_between_said_rooms_inside_drawn_walls_stay_open(tmp_path):
    outer = shapely.LineString(shapely.box(0, 0, 9, 4).exterior.coords)
    wall = shapely.MultiLineString([[(4, 0), (4, 1)], [(4, 2), (4, 4)]])
    rooms = [
        feature(shapely.box(0.1, 0.1, 3.9, 3.9), kind="room"),
        feature(shapely.box(4.1, 0.1, 8.9, 3.9), kind="room"),
    ]
    world = world_of(tmp_path, [feature(outer), feature(wall), *rooms])
    assert world.free.area == pytest.approx(8.9 * 3.9 - 2 * 0.1 * 1.5 - 0.1 * 0.8, abs=0.1)


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (shapely.Polygon([(0, 0), (9, 0), (0, 0)]), "expected walls, found none"),
        (shapely.Polygon([(0, 0), (9, 9), (9, 0), (0, 9)]), None),
        (shapely.Polygon([(0, 0), (9, 0), (9, 0), (9, 9), (9, 9), (0, 9), (0, 0)]), None),
        (shapely.Polygon([(0, 0), (0.3, 0), (0.3, 9), (0, 9)]), "fits into"),
        (shapely.Polygon(ROOM.exterior.coords, [[(1, 1), (20, 1), (20, 2), (1, 2)]]), None),
        (shapely.Polygon(ROOM.exterior.coords, [[(1, 1), (1, 1), (1, 1), (1, 1)]]), None),
    ],
    ids=["flat", "bow tie", "double points", "narrow", "hole across", "hole of no area"],
)
def test_odd_polygons_are_mended_or_refused(tmp_path, shape, words):
    if words is None:
        assert world_of(tmp_path, [feature(shape)]).free.is_valid
        return
    with pytest.raises(WorldError, match=words):
        world_of(tmp_path, [feature(shape)])


def test_a_map_of_this_program_is_a_world_of_rooms_islands_and_open_chains(tmp_path):
    """The features that stand beside chains in map.geojson (walls, corners, the way) are no second set of walls."""
    island = shapely.box(4, 3, 5, 4)
    open_chain = shapely.LineString([(9, 2), (7, 2), (7, 1), (9, 1)])
    features = [
        feature(ROOM, kind="chain", closed=True, contour="room"),
        feature(island, kind="chain", closed=True, contour="island"),
        feature(shapely.LineString([(6, 5), (8, 5)]), kind="chain", closed=False),
        feature(shapely.LineString([(0, 0), (9, 0)]), kind="wall", id=3),
        feature(shapely.Point(0, 0), kind="corner", id=0),
        feature(open_chain, kind="trajectory"),
        feature(shapely.Point(2, 2), kind="start", id="start", heading=0.5),
    ]
    world = world_of(tmp_path, features, coordinate_system="local metres")
    same(world, ROOM.difference(island).difference(shapely.box(6, 4.9, 8, 5)))
    np.testing.assert_array_equal(world.start, [2, 2, 0.5])
    assert world.labels == {}
