"""What a certificate says of contours, of open ends, borders and things that are left, and of floor never seen."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chainslam.explore.certificate import certify, contours, floor_of, unseen_area
from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.goal import GivenUp, LeftPlace, SetAside
from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import MissionConfig, explore_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.map.chains import HEAD, TAIL, Chain, OpenEnd
from chainslam.slam.mapper import Mapper
from tests.explore.rings import closed_map

ROOM = shapely.orient_polygons(shapely.box(0, 0, 4, 4).difference(shapely.box(1.7, 1.6, 2.4, 2.3)))
START = np.array([0.7, 0.7, 0.3])
WAY = START[None, :2]


@pytest.fixture(scope="module")
def begun():
    """Return the second step of a mission in a room with a pillar, and the robot."""
    robot = SimulatedRobot(World("drawn", ROOM, START, {}), 1, errorless=True)
    mapper = Mapper(BACKENDS["full-ekf"].make(START.copy(), np.diag([0.01, 0.01, 0.002]) ** 2))
    mission = explore_mission(robot, mapper, STRATEGIES["nearest-robot"].make(), MissionConfig())
    *_, last = limited(mission, Limits(steps=2))
    return last, robot


def left(step, ends=(), places=()):
    """Return a step at which these ends and places were given up."""
    return replace(step, decision=replace(step.decision, given_up=GivenUp(ends, places, near_m=0.5)))


def mapped(step, ring):
    """Return a step whose map is one closed ring."""
    walls, chain = closed_map(np.asarray(ring, dtype=float))
    return replace(step, map=walls, chains=(chain,))


@settings(max_examples=60, deadline=None)
@example([(-3.2109375, 0.0), (1.0, 2.0)])
@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5)), min_size=2, max_size=9, unique=True))
def test_a_closed_chain_is_a_valid_polygon_whatever_its_corners(points):
    ring = np.round(np.array(points), 2)
    if min(np.hypot(*(ring - np.roll(ring, -1, axis=0)).T)) < 0.05:
        return
    walls, chain = closed_map(ring)
    for contour in contours(walls, (chain,)):
        assert contour.polygon.is_valid
        assert contour.polygon.exterior.is_ccw
        assert contour.polygon.area > 0


def test_a_slab_of_two_walls_is_an_island_and_a_turned_room_no_island():
    slab = np.array([[0.0, 0.0], [2.0, 0.0]])
    walls, chain = closed_map(slab)
    walls.belief.means[:, 1] -= 0.05
    (contour,) = contours(walls, (chain,))
    assert contour.is_island
    assert contour.polygon.area == pytest.approx(0.2)
    walls, chain = closed_map(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]))
    (room,) = contours(walls, (chain,))
    assert not room.is_island
    assert floor_of((room,)).area == pytest.approx(2.0)


def test_a_contour_has_the_corners_of_its_chain_however_short_its_walls_were_seen():
    triangle = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]])
    walls, chain = closed_map(triangle)
    walls.extents[:] *= 0.5
    (contour,) = contours(walls, (chain,))
    assert contour.polygon.area == pytest.approx(2.0)


def test_unseen_floor_is_measured_by_cells(begun):
    _, robot = begun
    free_space = FreeSpace()
    free_space.integrate(START, robot.sense())
    cells = np.argwhere(free_space.evidence == 0)
    points = free_space.points(cells)
    floor = shapely.MultiPolygon([ROOM.buffer(-0.1)])
    plain = np.count_nonzero(shapely.contains_xy(floor, points[:, 0], points[:, 1])) * 0.05**2
    assert plain > 0.3
    assert unseen_area(free_space, floor) == pytest.approx(plain, rel=0.15)


def test_unseen_floor_is_that_inside_cell_by_cell_and_none_where_a_floor_has_no_inside():
    """On a grid that is no square and begins elsewhere; all around the floor was seen, and in its hole nothing was."""
    free_space = FreeSpace(FreeSpaceConfig(cell_m=0.5))
    free_space._lay((12, 20))
    free_space._first[:] = -3, 4
    free_space.evidence[:] = -1
    free_space.evidence[2:9, 5:15] = 0
    corners = free_space.points(np.array([[2, 5], [8, 14], [4, 8], [6, 10]]))
    floor = shapely.box(*corners[:2].ravel())
    assert unseen_area(free_space, floor) == 70 * 0.25
    hole = shapely.box(*corners[2:].ravel())
    assert unseen_area(free_space, floor.difference(hole)) == (70 - 9) * 0.25
    free_space.evidence[3, 5:15] = 6
    assert unseen_area(free_space, shapely.MultiPolygon([floor])) == 60 * 0.25
    assert unseen_area(free_space, floor.buffer(-9.0)) == 0.0


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32), st.integers(3, 9), st.booleans())
def test_a_ring_run_through_counter_clockwise_is_a_room_wherever_it_lies_and_however_small(seed, count, turned):
    rng = np.random.default_rng(seed)
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    ring = rng.uniform(-5, 5, 2) + rng.uniform(0.3, 3.0) * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    walls, chain = closed_map(ring[::-1] if turned else ring)
    opened = Chain((7,), np.zeros((0, 2)), (OpenEnd(7, TAIL, ring[0]), OpenEnd(7, HEAD, ring[1])))
    (contour,) = contours(walls, (opened, chain))
    assert (contour.chain, contour.walls, contour.is_island) == (1, chain.walls, turned)
    assert contour.polygon.area == pytest.approx(shapely.Polygon(ring).area)


@pytest.mark.usefixtures("_unchecked")
def test_a_certificate_measures_the_floor_of_what_is_closed_and_what_of_it_was_never_seen(begun):
    last, _ = begun
    certificate = certify(
        mapped(last, [[30, 0], [32, 0], [32, 1], [30, 1]]), Outcome.STEP_LIMIT, PathConfig(), True, WAY
    )
    assert certificate.outcome is Outcome.STEP_LIMIT
    assert certificate.floor_m2 == pytest.approx(2.0)
    assert certificate.unseen_m2 == 0.0, "off the grid"
    room = mapped(last, [[0, 0], [4, 0], [4, 4], [0, 4]])
    points = last.free_space.points(np.argwhere(last.free_space.evidence == 0))
    unseen = np.count_nonzero(np.all(np.abs(points - 2.0) < 1.9, axis=1)) * 0.05**2
    certificate = certify(room, Outcome.STEP_LIMIT, PathConfig(), True, WAY)
    assert certificate.unseen_m2 == pytest.approx(unseen, rel=0.03)
    assert unseen > 0.3


@pytest.mark.usefixtures("_unchecked")
def test_nothing_is_said_of_floor_where_nobody_kept_it_nor_of_unseen_floor_where_no_room_is_closed(begun):
    last, _ = begun
    room = replace(mapped(last, [[0, 0], [4, 0], [4, 4], [0, 4]]), free_space=FreeSpace())
    kept_not = certify(room, last.outcome, PathConfig(), True, WAY)
    assert [kept_not.frontiers, kept_not.obstacles, kept_not.unseen_m2, kept_not.reachable_way] == [None] * 4
    assert kept_not.floor_m2 == pytest.approx(16.0)
    closed_none = certify(replace(last, chains=()), last.outcome, PathConfig(), True, WAY)
    assert (closed_none.floor_m2, closed_none.unseen_m2, closed_none.contours) == (0.0, None, ())


@pytest.mark.usefixtures("_unchecked")
@pytest.mark.parametrize(
    ("outcome", "otherwise"),
    [(Outcome.STEP_LIMIT, "not explored yet"), (Outcome.NONE_REACHABLE, "seen at the end")],
    ids=str,
)
def test_each_open_end_is_left_with_its_own_reason_or_what_the_missions_end_says(begun, outcome, otherwise):
    last, _ = begun
    ends = [end for chain in last.chains for end in chain.open_ends]
    wall, side, reason = ends[0].wall, ends[0].side, "no way leads there"
    step = left(last, ends=(SetAside(wall, side, np.zeros(2), reason), SetAside(wall, 1 - side, np.zeros(2), "other")))
    told = certify(step, outcome, PathConfig(), True, WAY).open_ends
    assert [(end.wall, end.side) for end in told] == [(end.wall, end.side) for end in ends]
    np.testing.assert_array_equal([end.position_world for end in told], [end.position_world for end in ends])
    reasons = {(wall, side): reason, (wall, 1 - side): "other"}
    assert [end.why for end in told] == [reasons.get((end.wall, end.side), otherwise) for end in ends]
    assert reason in {end.why for end in told}
    assert otherwise in {end.why for end in told}


@pytest.mark.usefixtures("_unchecked")
def test_borders_are_left_with_the_words_of_their_visits(begun):
    last, _ = begun
    border = certify(last, last.outcome, PathConfig(), True, WAY).frontiers[0]
    assert border.length_m == pytest.approx(0.05 * len(border.cells_world))
    middle = border.cells_world.mean(axis=0)
    for troubles, sweep, why in (
        ((), True, "not visited yet"),
        (("", ""), True, "visited 2 times, and what lies behind was not all seen from there"),
        (("narrow", "blocked", ""), True, "not reached: blocked"),
        (("",), False, "unseen floor was not to be visited"),
    ):
        step = left(last, places=tuple(LeftPlace(middle, trouble) for trouble in troubles))
        assert certify(step, last.outcome, PathConfig(), sweep, WAY).frontiers[0].why == why
