"""The seven steps over exact scans of drawn rooms, and with oracles in place of extraction and matching."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.stats import chi2

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.matching import NO_MATCHES, KnownWalls, match
from chainslam.slam.backends import BACKENDS
from chainslam.slam.config import MapperConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.poses import compose, inverse, wrap
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan

P0 = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2
ODOMETRY_COV = np.diag([0.01, 0.01, 0.005]) ** 2
AT_ITS_WORD = MapperConfig(recovery=None)
"""Nothing is matched once more to see whether the robot moved without saying so."""
PLACES = [[1.5, 1.2, 0.3], [2.4, 1.3, 1.2], [2.3, 2.1, -2.0], [1.0, 2.2, 3.0], [1.1, 1.0, 0.0]]


def faces_of(polygon):
    polygon = shapely.orient_polygons(polygon)
    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])


SQUARE = faces_of(shapely.box(0, 0, 3.4, 3.4))


def walk(faces, places, backend="full-ekf", rng=None, **oracles):
    """Yield what each scan of an exact walk does to the map; with a generator scans are noisy."""
    finder = RangeFinder(faces, LidarConfig())
    places = np.asarray(places, dtype=float)
    mapper = Mapper(BACKENDS[backend].make(places[0].copy(), P0.copy()), **oracles)
    for k, pose in enumerate(places):
        if k:
            mapper.predict(Odometry(compose(inverse(places[k - 1]), pose), ODOMETRY_COV))
        ranges = finder.cast(pose)[0]
        if rng is not None:
            ranges = ranges + 0.01 * rng.standard_normal(len(ranges))
        yield mapper.step(Scan(finder.bearings_rad, ranges, 0.01, 4.0, 0.1 * k))


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_a_square_room_is_four_walls_in_one_closed_chain(backend):
    *_, last = walk(SQUARE, PLACES, backend)
    assert len(last.map) == 4
    (chain,) = last.chains
    assert chain.is_closed
    corners = {tuple(corner) for corner in np.round(chain.corners_world, 2) + 0.0}
    assert corners == {(0.0, 0.0), (3.4, 0.0), (3.4, 3.4), (0.0, 3.4)}
    np.testing.assert_allclose(last.map.belief.pose_world, PLACES[-1], atol=1e-4)


def test_every_segment_of_a_known_room_belongs_to_a_wall_of_the_map():
    first, *rest = walk(SQUARE, PLACES)
    assert sorted(first.walls_of_segments.tolist()) == first.map.ids.tolist()
    assert first.map.tentative.all()
    for update in rest:
        assert sorted(update.walls_of_segments.tolist()) == first.map.ids.tolist()
        assert len(update.matches.unmatched) == 0
    assert not update.map.tentative.any()
    assert np.all(update.map.observations == len(PLACES))


@pytest.mark.parametrize("backend", list(BACKENDS))
@pytest.mark.parametrize("world", [np.array([100.0, -100.0, 0.0]), np.array([3.0, 40.0, 2.3])])
def test_a_moved_world_gives_the_moved_map(backend, world):
    def moved(points):
        c, s = np.cos(world[2]), np.sin(world[2])
        return points @ np.array([[c, -s], [s, c]]).T + world[:2]

    *_, here = walk(SQUARE, PLACES, backend)
    *_, there = walk(moved(SQUARE), [compose(world, np.array(place)) for place in PLACES], backend)
    np.testing.assert_array_equal(there.map.ids, here.map.ids)
    np.testing.assert_allclose(there.map.ends_world, moved(here.map.ends_world), atol=1e-6)
    assert [chain.walls for chain in there.chains] == [chain.walls for chain in here.chains]


def test_a_matcher_given_in_its_place_is_asked_for_the_clear_and_then_for_the_rest_and_believed():
    """Nothing is asked where none is left; an oracle that knows the true wall of every segment is obeyed."""
    asked = []

    def oracle(segments, walls, joint, config, *, clear_only=False):
        asked.append(clear_only)
        return match(segments, walls, joint, config, clear_only=clear_only)

    updates = list(walk(SQUARE, PLACES, matcher=oracle, config=AT_ITS_WORD))
    assert asked[:2] == [True, False]
    assert asked.count(True) == len(PLACES) >= asked.count(False)
    for mine, usual in zip(updates, walk(SQUARE, PLACES), strict=True):
        np.testing.assert_array_equal(mine.map.belief.means, usual.map.belief.means)
        np.testing.assert_array_equal(mine.map.belief.pose_cov, usual.map.belief.pose_cov)


def nothing(segments, walls, joint, config, *, clear_only=False):
    return replace(NO_MATCHES, unmatched=np.arange(len(segments)))


def test_a_matcher_that_knows_no_wall_makes_every_segment_a_new_one():
    first, second, *_ = walk(SQUARE, PLACES, matcher=nothing)
    assert len(first.map) == 4
    assert set(second.walls_of_segments.tolist()).isdisjoint(first.map.ids.tolist())
    np.testing.assert_allclose(second.map.belief.pose_world, PLACES[1], atol=1e-12)


def test_doubtful_segments_are_neither_fused_nor_entered():
    def doubter(segments, walls, joint, config, *, clear_only=False):
        every = np.arange(len(segments))
        return replace(NO_MATCHES, unmatched=every, doubtful=every)

    for update in walk(SQUARE, PLACES[:3], matcher=doubter):
        assert len(update.map) == 0
        assert np.all(update.walls_of_segments == -1)


def test_an_extractor_given_in_its_place_is_believed():
    def not_behind(scan, config):
        segments = extract(scan, config)
        return segments.take(np.flatnonzero(np.cos(segments.lines[:, 0]) > -0.5))

    for update in walk(SQUARE, PLACES, extractor=not_behind):
        assert len(update.segments) >= 2
        assert np.all(np.cos(update.segments.lines[:, 0]) > -0.5)


def test_a_segment_of_few_beams_stretches_no_wall_though_it_lies_on_one():
    def few_first(scan, config):
        segments = extract(scan, config)
        few = segments.is_tentative | (np.arange(len(segments)) == 0)
        return replace(segments, is_tentative=few) if scan.time_s > 0.15 else segments

    *_, last = walk(SQUARE, PLACES[:3], extractor=few_first)
    assert 0 in last.matches.pairs[:, 0]
    assert [owner < 0 for owner in last.walls_of_segments] == [True] + [False] * (len(last.segments) - 1)


def test_a_wall_that_was_there_and_is_gone_is_cut_back():
    """A pillar stands at first; then beams pass where it stood, in scan after scan."""
    room = shapely.box(0, 0, 3.4, 3.4)
    before = faces_of(room.difference(shapely.box(1.5, 1.5, 2.1, 1.8)))
    finders = [RangeFinder(faces, LidarConfig()) for faces in (before, SQUARE)]
    inside = shapely.box(1.4, 1.4, 2.2, 1.9)
    pose = np.array([1.8, 0.8, 0.4])
    mapper = Mapper(BACKENDS["full-ekf"].make(pose.copy(), P0.copy()))

    def scan(k):
        return Scan(finders[k].bearings_rad, finders[k].cast(pose)[0], 0.01, 4.0, 0.0)

    with_pillar = [mapper.step(scan(0)) for _ in range(3)][-1]
    stands = [shapely.LineString(ends).intersection(inside).length for ends in with_pillar.map.ends_world]
    assert max(stands) > 0.5
    without = [mapper.step(scan(1)) for _ in range(6)][-1]
    left = [shapely.LineString(ends).intersection(inside).length for ends in without.map.ends_world]
    assert max(left) < 0.3


def test_walls_hidden_behind_something_are_not_cut_back():
    """A pillar set down before a known wall hides it: nobody saw that the wall is gone."""
    room = shapely.box(0, 0, 3.4, 3.4)
    after = faces_of(room.difference(shapely.box(1.2, 2.2, 2.4, 2.6)))
    finders = [RangeFinder(faces, LidarConfig()) for faces in (SQUARE, after)]
    pose = np.array([1.8, 0.8, 0.4])
    mapper = Mapper(BACKENDS["full-ekf"].make(pose.copy(), P0.copy()))

    def scan(k):
        return Scan(finders[k].bearings_rad, finders[k].cast(pose)[0], 0.01, 4.0, 0.0)

    known = [mapper.step(scan(0)) for _ in range(3)][-1]
    hidden = [mapper.step(scan(1)) for _ in range(10)][-1]
    rows = np.searchsorted(hidden.map.ids, known.map.ids)
    np.testing.assert_array_equal(hidden.map.ids[rows], known.map.ids)
    np.testing.assert_allclose(hidden.map.ends_world[rows], known.map.ends_world, atol=0.02)


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_the_same_noise_gives_the_same_map_bit_for_bit(backend):
    runs = [list(walk(SQUARE, PLACES * 3, backend, np.random.default_rng(3)))[-1] for _ in range(2)]
    assert runs[0].map.belief.means.tobytes() == runs[1].map.belief.means.tobytes()
    assert runs[0].map.extents.tobytes() == runs[1].map.extents.tobytes()


def test_extents_and_ends_follow_the_line_they_are_measured_along():
    *_, last = walk(SQUARE, PLACES, rng=np.random.default_rng(5))
    alpha, r = last.map.belief.lines_world.T
    off = np.einsum("nd,ned->ne", np.stack([np.cos(alpha), np.sin(alpha)], axis=-1), last.map.ends_world)
    np.testing.assert_allclose(off, np.repeat(r[:, None], 2, axis=1), atol=1e-12)
    along = last.map.ends_world[:, 1] - last.map.ends_world[:, 0]
    np.testing.assert_allclose(np.hypot(*along.T), last.map.extents[:, 1] - last.map.extents[:, 0], atol=1e-12)


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_walls_that_were_entered_twice_are_merged(backend):
    """Matching sees none of the walls of before for two scans, so that all are entered again, and seen again."""
    scans = {"at": 0}

    def blind(segments, walls, joint, config, *, clear_only=False):
        scans["at"] += clear_only
        if scans["at"] in (6, 7):
            late = np.flatnonzero(walls.ids >= 4)
            walls, joint = KnownWalls(walls.ids[late], walls.extents[late]), joint.take(late)
        return match(segments, walls, joint, config, clear_only=clear_only)

    updates = list(walk(SQUARE, PLACES * 2, backend, matcher=blind, config=AT_ITS_WORD))
    last = updates[-1]
    assert len(updates[5].map) == 8
    assert updates[6].merged == ((0, 4), (1, 5), (2, 6), (3, 7))
    assert last.map.ids.tolist() == [0, 1, 2, 3]
    assert [chain.is_closed for chain in last.chains] == [True]
    assert set(last.walls_of_segments.tolist()) <= {-1, *last.map.ids.tolist()}


def test_an_end_of_few_beams_becomes_a_wall_once_places_enough_showed_it():
    """The end of a wall of 0.1 m, 1.4 m away: three beams."""
    room = faces_of(shapely.box(0, 0, 3.4, 3.4).difference(shapely.box(0, 1.65, 1.4, 1.75)))
    updates = list(walk(room, [[2.8, 1.6 + 0.1 * (k % 2), 0.0] for k in range(6)]))

    def is_end(update):
        alpha, middle = update.map.belief.means[:, 0], update.map.ends_world.mean(axis=1)
        return (np.cos(alpha) < -0.9) & (np.hypot(*(middle - [1.4, 1.7]).T) < 0.05)

    count = [int(np.count_nonzero(is_end(update))) for update in updates]
    assert (count[0], count[-1]) == (0, 1)
    became = updates[count.index(1)]
    assert not became.map.tentative[is_end(became)].any(), "more than one sure segment speaks for it"


@pytest.mark.parametrize(("turn_rad", "count"), [(0.0, 1), (0.9, 1), (1.1, 0)])
def test_a_line_of_few_beams_that_may_point_anywhere_begins_no_wall(turn_rad, count):
    """The end of a wall of 0.1 m again: pointing anywhere it would be one with any wall near by."""
    room = faces_of(shapely.box(0, 0, 3.4, 3.4).difference(shapely.box(0, 1.65, 1.4, 1.75)))

    def vague(scan, config):
        segments = extract(scan, config)
        segments.cov[segments.is_tentative, 0, 0] += turn_rad**2
        return segments

    *_, last = walk(room, [[2.8, 1.6 + 0.1 * (k % 2), 0.0] for k in range(6)], extractor=vague)
    middles = last.map.ends_world.mean(axis=1)
    assert np.count_nonzero(np.hypot(*(middles - [1.4, 1.7]).T) < 0.05) == count


def test_scans_from_afar_that_show_one_line_over_two_faces_move_the_robot_by_no_more_than_is_stated():
    """A wall that turns by a degree, first from 0.4 m, then from 2.6 m, where the line moves the robot by 4 mm."""
    slope = np.tan(np.deg2rad(1.0))
    room = faces_of(shapely.Polygon([(0, 0), (4, 0), (8, -4 * slope), (8, 3), (0, 3)]))
    near = [(x, 0.4 - max(x - 4, 0) * slope, 0.0) for x in np.arange(1.0, 6.0, 0.1)]
    away = [(5.9, y, 0.0) for y in np.arange(0.4, 2.6, 0.1)]
    far = [(x, 2.6, np.pi) for x in np.arange(5.9, 2.0, -0.1)]
    places = np.array([*near, *away, *far])
    for pose, update in zip(places, walk(room, places), strict=True):
        off = update.map.belief.pose_world - pose
        off[2] = wrap(off[2])
        assert off @ np.linalg.solve(update.map.belief.pose_cov, off) < chi2.ppf(0.95, 3)


@pytest.mark.parametrize("backend", [name for name in BACKENDS if name not in ("block-ekf", "joint-block-ekf")])
def test_a_line_laid_across_a_bend_from_afar_turns_the_robot_by_no_more_than_is_stated(backend):
    """A wall that turns by 4.3 degrees, met head on: 14 beams of both sides, then two pieces."""
    faces = np.array([[[3.0, 0.0], [-0.68, 0.0]], [[-0.68, 0.0], [-3.67, -0.223]]])
    places = np.array([(0.0, y, 0.5 * np.pi) for y in np.arange(-3.87, -2.5, 0.15)])
    finder, wheels = RangeFinder(faces, LidarConfig()), np.diag([0.01, 0.01, np.deg2rad(1.5)]) ** 2
    mapper = Mapper(BACKENDS[backend].make(places[0], 1e-8 * np.eye(3)))
    for k, place in enumerate(places):
        if k:
            mapper.predict(Odometry(compose(inverse(places[k - 1]), place), wheels))
        update = mapper.step(Scan(finder.bearings_rad, finder.cast(place)[0], 0.01, 4.0, 0.1 * k))
        assert k or len(update.map) == 1, "one line, at first"
        off = update.map.belief.pose_world - place
        assert off @ np.linalg.solve(update.map.belief.pose_cov, off) < chi2.ppf(0.95, 3)
    assert len(update.map) == 2


def test_few_beams_that_show_nothing_in_its_place_undo_a_line_of_few_beams():
    """The end of a wall of 0.1 m, seen once from 1.4 m; then the wall is gone, and some four beams pass from 0.7 m."""
    room = shapely.box(0, 0, 3.4, 3.4)
    faces = faces_of(room.difference(shapely.box(0, 1.65, 1.4, 1.75))), faces_of(room)
    mapper, left = Mapper(BACKENDS["full-ekf"].make(np.array([2.8, 1.6, 0.0]), P0.copy())), []
    for k, there in enumerate((faces[0], faces[1])):
        pose = np.array([2.8 - 0.7 * k, 1.6, 0.0])
        if k:
            mapper.predict(Odometry(np.array([-0.7, 0.0, 0.0]), ODOMETRY_COV))
        finder = RangeFinder(there, LidarConfig())
        mapper.step(Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.1 * k))
        left.append(len(mapper._keeper._candidates))
    assert left[0] > 0 == left[1]
