"""A scan laid on a whole map: the true place is found, and where two are alike none is named."""

import tracemalloc

import numpy as np
import pytest

from chainslam.sim.lidar import LidarConfig, RangeFinder, noisy
from chainslam.slam.association import place_search
from chainslam.slam.association.place_search import PlaceSearchConfig, place_of, places_anywhere
from chainslam.slam.association.recovery import RecoveryConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.poses import rotation, wrap
from chainslam.slam.robot import Scan
from tests.slam.extraction.test_extract import loop
from tests.slam.map.maps import map_of as walls_of

CROOKED = loop((0, 0), (6, 0), (6, 2), (4.5, 2), (4.5, 4.2), (2, 4.2), (2, 3), (0, 3))
SQUARE = loop((0, 0), (4, 0), (4, 4), (0, 4))
WHOLE_MAP = RecoveryConfig().place
CONFIG = LidarConfig(beams=360, range_max_m=8.0)


def scan_at(faces, pose, rng):
    finder = RangeFinder(faces, CONFIG)
    ranges = noisy(finder.cast(pose)[0], np.full(360, 0.01), rng.standard_normal(360), CONFIG.range_max_m)
    return Scan(finder.bearings_rad, ranges, 0.01, CONFIG.range_max_m, 0.0)


@pytest.mark.parametrize("seed", range(12))
def test_a_scan_is_found_wherever_it_was_taken_and_whatever_is_believed(seed):
    rng = np.random.default_rng(seed)
    pose = np.array([rng.uniform(1.0, 4.0), rng.uniform(0.5, 2.5), rng.uniform(-np.pi, np.pi)])
    segments = extract(scan_at(CROOKED, pose, rng))
    place = place_of(segments, walls_of(CROOKED, np.zeros(3)), WHOLE_MAP)
    assert np.hypot(*(place - pose)[:2]) < 0.1
    assert abs(wrap(place[2] - pose[2])) < np.deg2rad(2.0)


def test_in_a_square_room_no_place_is_named_unless_one_is_likely():
    rng = np.random.default_rng(0)
    pose = np.array([1.2, 1.5, 0.4])
    segments = extract(scan_at(SQUARE, pose, rng))
    assert place_of(segments, walls_of(SQUARE, np.zeros(3)), WHOLE_MAP) is None
    np.testing.assert_array_equal(place_of(segments, walls_of(SQUARE, np.zeros(3)), WHOLE_MAP, likely_world=pose), pose)


def test_a_likely_place_that_explains_little_is_not_taken():
    rng = np.random.default_rng(0)
    pose = np.array([1.2, 1.5, 0.4])
    segments = extract(scan_at(CROOKED, pose, rng))
    place = place_of(segments, walls_of(CROOKED, np.zeros(3)), WHOLE_MAP, likely_world=pose + 0.5)
    assert np.hypot(*(place - pose)[:2]) < 0.1


def test_a_scan_of_another_building_has_no_place():
    segments = extract(scan_at(SQUARE, np.array([1.2, 1.5, 0.4]), np.random.default_rng(0)))
    assert place_of(segments, walls_of(CROOKED, np.zeros(3)), WHOLE_MAP) is None


def test_an_empty_map_has_no_place():
    segments = extract(scan_at(SQUARE, np.array([1.2, 1.5, 0.4]), np.random.default_rng(0)))
    assert place_of(segments.take(np.zeros(0, dtype=np.int64)), walls_of(SQUARE, np.zeros(3)), WHOLE_MAP) is None
    assert place_of(segments, walls_of(SQUARE[:0], np.zeros(3)), WHOLE_MAP) is None


def test_in_a_building_of_a_hundred_metres_the_search_takes_little_memory():
    """All turns and blocks of places at once would take 300 MiB: those that cannot fit are left out as they are met."""
    rng = np.random.default_rng(2)
    pose = np.array([1.2, 1.5, 0.4])
    segments = extract(scan_at(CROOKED, pose, rng))
    room = loop((0, 0), (4, 0), (4, 3), (0, 3))
    turns = rng.choice([0.0, 0.3, 0.6, 0.9], 99)
    rooms = [room @ rotation(turn).T + 10.0 * np.array(divmod(k, 10)) for k, turn in enumerate(turns, 1)]
    walls = walls_of(np.concatenate([CROOKED, *rooms]), np.zeros(3))
    tracemalloc.start()
    place = place_of(segments, walls, WHOLE_MAP)
    most_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most_bytes < 60 * 2**20
    assert np.hypot(*(place - pose)[:2]) < 0.1


def test_a_robot_that_stands_beside_all_walls_is_found_too():
    rng = np.random.default_rng(0)
    pose = np.array([-1.2, -0.9, 0.4])
    outside = CROOKED[:, ::-1]
    place = place_of(extract(scan_at(outside, pose, rng)), walls_of(outside, np.zeros(3)), WHOLE_MAP)
    assert np.hypot(*(place - pose)[:2]) < 0.1


@pytest.mark.parametrize(
    ("changed", "most", "expected"),
    [
        ({}, 9, [0, 2]),
        ({"rival": 0.8}, 9, [0, 2, 3]),
        ({"least": 0.95}, 9, [0]),
        ({"rival": 0.1, "least": 0.1}, 3, [0, 2, 3]),
    ],
)
def test_places_are_those_about_as_good_as_the_best_and_apart_from_better_ones(monkeypatch, changed, most, expected):
    poses = np.array([[0.0, 0, 0], [0.1, 0, 0], [3.0, 0, 0], [6.0, 0, 0], [9.0, 0, 0]])
    scores = np.array([1.0, 0.97, 0.93, 0.85, 0.4])
    monkeypatch.setattr(place_search, "_fitting", lambda *_: (poses[::-1], scores[::-1]))
    config = PlaceSearchConfig(least=changed.get("least", 0.5), rival=changed.get("rival", 0.9))
    found = places_anywhere(np.zeros((2, 2)), np.zeros((2, 2)), config, most)
    np.testing.assert_array_equal(found, poses[expected])
