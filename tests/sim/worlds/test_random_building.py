"""Every seed gives a building that a robot can drive all through, and not all of them look alike."""

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chainslam.sim.worlds import World, WorldError, listing, load
from chainslam.sim.worlds.random.floor_plan import DOOR_M, STYLES, floor_plan
from chainslam.sim.worlds.world import SENSOR_RANGE_M

SEEDS = st.integers(0, 2**64 - 1)
QUICK = settings(max_examples=10, deadline=None, database=None)


def opened(shape, width_m):
    """Return a shape without what is narrower than a width, its corners as they were."""
    inner = shape.buffer(-0.5 * width_m, quad_segs=16)
    return inner.buffer(0.505 * width_m, join_style="mitre", mitre_limit=10).buffer(0).intersection(shape)


@pytest.fixture(scope="module")
def forty():
    return [load(f"random:{seed}") for seed in range(1, 41)]


@QUICK
@given(SEEDS)
def test_all_of_the_floor_is_one_valid_region_that_a_robot_passes_through(seed):
    world = load(f"random:{seed}")
    at = shapely.Point(world.start[:2])
    roomy = world.free.buffer(-0.49 * DOOR_M[0])
    assert world.free.is_valid
    assert world.free.contains(at)
    assert world.free.boundary.distance(at) >= 0.4
    # Every door and every gap is 0.6 m wide or wider, so that a disc of nearly that size comes everywhere, but for the
    # pockets between a door and a slanted wall beside it.
    assert roomy.geom_type == "Polygon"
    assert world.free.area - opened(world.free, 0.98 * DOOR_M[0]).area < 0.3


@QUICK
@example(66596)
@given(SEEDS)
def test_walls_are_solid_and_no_face_is_a_sliver(seed):
    world = load(f"random:{seed}")
    solid = shapely.box(*world.free.bounds).buffer(1.0).difference(world.free)
    assert solid.area - opened(solid, 0.098).area < 1e-3
    assert np.hypot(*(world.faces[:, 1] - world.faces[:, 0]).T).min() >= 0.0999
    assert min(sides(world)) > 2.0
    assert max(sides(world)) < 21.0


@QUICK
@given(SEEDS)
def test_one_seed_is_one_building_and_another_seed_another(seed):
    world, again, other = (load(f"random:{k}") for k in (seed, seed, (seed + 1) % 2**64))
    np.testing.assert_array_equal(world.faces, again.faces)
    np.testing.assert_array_equal(world.start, again.start)
    assert world.name == f"random:{seed}"
    assert world.faces.shape != other.faces.shape or not np.allclose(world.faces, other.faces)


def sides(world: World):
    ring = shapely.get_coordinates(shapely.minimum_rotated_rectangle(world.free))
    return np.hypot(*np.diff(ring[:3], axis=0).T)


def test_among_forty_there_are_rings_slanted_walls_and_plain_rooms(forty):
    islands = [world.face_rings.max() for world in forty]
    slanted = [len(directions(world)) > 1 for world in forty]
    assert min(islands) == 0
    assert max(islands) >= 5
    assert 5 < sum(slanted) < 40
    assert len({len(world.faces) for world in forty}) > 20


def directions(world: World):
    """Return the directions of long walls, up to right angles, in steps of a degree."""
    along = world.faces[:, 1] - world.faces[:, 0]
    long = np.hypot(*along.T) > 1.0
    angle = np.rad2deg(np.arctan2(along[long, 1], along[long, 0])) - np.rad2deg(np.arctan2(*along[long][0][::-1]))
    return set((np.round(angle) % 90).tolist())


def test_every_style_gives_a_plan_whose_doors_join_all_rooms():
    for style in STYLES:
        for seed in range(10):
            plan = floor_plan(style, np.random.default_rng(seed))
            assert len(plan.doors) >= len(plan.rooms) - 1
            assert plan.floor.is_valid


def test_some_halls_hide_all_walls_from_a_range_finder_in_their_middle():
    hall = next(style for style in STYLES if style.name == "hall")
    rooms = [room for seed in range(20) for room in floor_plan(hall, np.random.default_rng(seed)).rooms]
    radius = [shapely.length(shapely.maximum_inscribed_circle(room, tolerance=0.05)) for room in rooms]
    assert min(radius) < 3.0
    assert max(radius) > SENSOR_RANGE_M + 0.4


@pytest.mark.parametrize("which", ["", "x", "-1", "1.5", "1e3", " 7", "٣", "18446744073709551616", "9" * 5000])
def test_a_bad_seed_is_told_in_one_line(which):
    with pytest.raises(WorldError) as caught:
        load(f"random:{which}")
    assert "expected a seed" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


def test_every_listed_name_can_be_loaded():
    assert "random:1" in listing()
    assert all(load(name).name == name for name in listing())
