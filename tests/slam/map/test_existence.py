"""Walls are believed and forgotten by what looks at them say."""

from dataclasses import replace
from math import log

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.existence import JUST_BEGUN, NOWHERE, ExistenceConfig, log_odds
from chainslam.slam.map.kernels.existence_kernels import Odds, look
from chainslam.slam.map.kernels.ray_evidence import ray_evidence
from chainslam.slam.robot import Scan

CONFIG = ExistenceConfig()
ODDS = CONFIG.odds(5)
ORIGIN = np.zeros(3)
WALL = [[1.0, -0.5], [1.0, 0.5]]
seeds = st.integers(0, 2**32)


def scan_of(faces, pose=ORIGIN):
    finder = RangeFinder(np.asarray(faces, dtype=float).reshape(-1, 2, 2), LidarConfig())
    return Scan(finder.bearings_rad, finder.cast(np.asarray(pose, dtype=float))[0], 0.01, 4.0, 0.0)


def lines_of(faces):
    """Return anchors, means and extents of the walls that stand for faces."""
    faces = np.asarray(faces, dtype=float)
    lines, anchors = through(faces), faces.mean(axis=1)
    means = np.column_stack([lines[:, 0], lines[:, 1] - np.vecdot(normals(lines[:, 0]), anchors)])
    half = 0.5 * np.hypot(*(faces[:, 1] - faces[:, 0]).T)
    return anchors, means, np.column_stack([-half, half])


def beams_on(face, shown, pose=ORIGIN):
    scan = scan_of(shown, pose)
    anchors, means, extents = lines_of([face])
    rays = ray_evidence(scan, np.asarray(pose, dtype=float), anchors, means)
    return int(rays.reaching(extents, ODDS.margin_m)[0])


def test_beams_that_end_on_a_wall_or_go_on_beyond_it_reach_it_and_no_others():
    """A beam every 2 degrees: 26 between the ends of a metre of wall a metre away."""
    before, behind, beside = [[0.9, -0.5], [0.9, 0.5]], [[1.5, -1.5], [1.5, 1.5]], [[1.0, 0.6], [1.0, 1.5]]
    on = int(np.count_nonzero(np.abs(scan_of([WALL]).bearings_rad) < np.arctan(0.5)))
    assert beams_on(WALL, [WALL]) == beams_on(WALL, [behind]) == beams_on(WALL, [beside]) == on > 20
    assert beams_on(WALL, [before]) == 0
    assert beams_on(WALL, [[[0.97, -0.5], [0.97, 0.5]]]) == on  # within four sigmas of a beam
    assert beams_on(WALL[::-1], [WALL]) == 0  # from behind no beam reaches its face
    assert beams_on([[5.0, -0.5], [5.0, 0.5]], [beside]) == 0  # nor out of range


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=seeds)
def test_a_look_counts_by_what_it_shows_once_from_each_place(seed):
    rng = np.random.default_rng(seed)
    odds = Odds(1.5, -2.0, 5.0, 7, 0.1, 0.04)
    n = 12
    pose, beams, seen = np.array([*rng.uniform(-0.2, 0.2, 2), 0.3]), rng.integers(0, 15, n), rng.random(n) < 0.5
    before, places = rng.uniform(-3.0, 5.0, n), rng.uniform(-0.2, 0.2, (n, 2))
    places[0], places[1] = JUST_BEGUN, NOWHERE
    after, at = before.copy(), places.copy()
    look(pose, beams, seen, after, at, odds)
    np.testing.assert_array_equal(at[0], NOWHERE)
    assert after[0] == before[0]
    for k in range(1, n):
        counts = (seen[k] or beams[k] >= 7) and np.hypot(*(pose[:2] - places[k])) >= 0.1
        change = (1.5 if seen[k] else -2.0) if counts else 0.0
        assert after[k] == min(before[k] + change, 5.0)
        np.testing.assert_array_equal(at[k], pose[:2] if counts else places[k])


def test_the_odds_are_those_of_the_shares():
    assert log_odds(0.97) == pytest.approx(log(0.97 / 0.03))
    assert ODDS[:4] == pytest.approx((log(0.9 / 0.2), log(0.1 / 0.8), log((1 - 1e-6) / 1e-6), 7))
    assert CONFIG.few_odds(3)[:4] == pytest.approx((log(0.9 / 0.5), log(0.1 / 0.5), ODDS.most, 3))
    np.testing.assert_allclose(CONFIG.begins(np.array([True, False])), [log(0.73 / 0.27), log(0.93 / 0.07)])


def test_shares_that_are_certain_decide_by_one_look():
    """What is never missed is gone once it is missed, and what only walls show is one once it is shown."""
    assert replace(CONFIG, shown=1.0).odds(5).missed == -np.inf
    assert replace(CONFIG, shown_over_faces=0.0).odds(5).seen == np.inf
    assert replace(CONFIG, over_faces=0.0).believed == np.inf == log_odds(1.0) == -log_odds(0.0)


def looks(shown, places, config=CONFIG, is_unsure=False):
    """Return the log odds of `WALL` after looks at faces from places; it is seen where it is one of the faces."""
    odds, last = np.array([CONFIG.believed]), np.tile(NOWHERE, (1, 1))
    for faces, place in zip(shown, places, strict=True):
        pose = np.array([*place, 0.0])
        beams = np.array([0 if is_unsure else beams_on(WALL, faces, pose)])
        look(pose, beams, np.array([WALL in faces]), odds, last, config.odds(5))
    return float(odds[0])


def test_two_faces_in_its_place_undo_a_wall_and_from_one_place_they_are_one_look():
    """A corner whose faces run on beyond the line across it."""
    faces = [[[1.0, -0.5], [1.3, 0.0]], [[1.3, 0.0], [1.0, 0.5]]]
    moving = [(0.0, 0.1 * k) for k in range(2)]
    assert looks([faces] * 2, moving) < 0.0 < looks([faces] * 2, [(0.0, 0.0)] * 2)
    assert looks([faces] * 2, moving, is_unsure=True) == CONFIG.believed


def test_a_wall_that_was_seen_for_long_is_no_surer_than_chance_lets_it_be_and_can_be_undone():
    often, gone = [[WALL]] * 50, [[[[3.0, -2.0], [3.0, 2.0]]]] * 10
    places = [(0.0, 0.1 * (k % 2)) for k in range(60)]
    assert looks(often, places[:50]) == pytest.approx(log_odds(1.0 - CONFIG.shared.chance))
    assert looks([*often, *gone], places) < 0.0


def test_looks_that_show_both_alike_say_nothing():
    nothing = replace(CONFIG, shown=0.5, shown_over_faces=0.5)
    assert looks([[WALL], [[[3.0, -2.0], [3.0, 2.0]]]], [(0.0, 0.0), (0.0, 0.1)], nothing) == CONFIG.believed
