"""The range finder against slow truths: every beam against every face, and shapely."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.sim.lidar import LidarConfig, RangeFinder, beam_sigmas, bearings, noisy
from chainslam.slam.robot import Scan

FULL = LidarConfig()
HALF = LidarConfig(beams=181, fov_rad=np.pi)
ODD = LidarConfig(beams=77, fov_rad=2.0, range_max_m=2.5)


def brute_force(faces, config, pose):
    """Return the range of each beam, and which beams pass within 1e-7 rad of an end of a face."""
    directions = bearings(config) + pose[2]
    d = np.stack([np.cos(directions), np.sin(directions)], axis=-1)[:, None]
    start, along = faces[:, 0] - pose[:2], faces[:, 1] - faces[:, 0]
    det = d[..., 0] * along[:, 1] - d[..., 1] * along[:, 0]
    safe = np.where(det > 0, det, 1.0)
    distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / safe
    share = (start[:, 0] * d[..., 1] - start[:, 1] * d[..., 0]) / safe
    hit = (det > 0) & (distance > 0) & (share >= 0) & (share <= 1)
    ranges = np.where(hit, distance, np.inf).min(axis=1)
    ends = (faces - pose[:2]).reshape(-1, 2)
    miss = np.arctan2(ends[:, 1], ends[:, 0]) - directions[:, None]
    near_an_end = np.abs((miss + np.pi) % (2 * np.pi) - np.pi).min(axis=1) < 1e-7
    return np.where(ranges <= config.range_max_m, ranges, np.inf), near_an_end


def room(x0, y0, x1, y1):
    """Return the faces of a rectangle seen from within."""
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], dtype=float)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


@pytest.mark.parametrize("config", [FULL, HALF, ODD])
@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32), heading=st.floats(-20.0, 20.0))
def test_every_beam_equals_brute_force_in_a_random_world(config, seed, heading):
    rng = np.random.default_rng(seed)
    faces = rng.uniform(-4.0, 4.0, (rng.integers(1, 60), 1, 2)) + rng.normal(
        0.0, rng.choice([0.1, 1.0, 5.0]), (1, 2, 2)
    )
    faces[:, 1] += rng.normal(0.0, 1.0, (len(faces), 2))
    pose = np.array([*rng.uniform(-3.0, 3.0, 2), heading])
    ranges, face = RangeFinder(faces, config).cast(pose)
    expected, near_an_end = brute_force(faces, config, pose)
    grazing = np.abs(expected - config.range_max_m) < 1e-6
    sure = ~near_an_end & ~grazing
    np.testing.assert_allclose(ranges[sure], expected[sure], rtol=1e-7)
    assert np.array_equal(face >= 0, np.isfinite(ranges))
    for beam in np.flatnonzero(sure & (face >= 0)):
        alone, _ = brute_force(faces[face[beam]][None], config, pose)
        assert alone[beam] == pytest.approx(ranges[beam], rel=1e-7)


@given(seed=st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_ranges_in_a_room_with_pillars_equal_shapely(seed):
    rng = np.random.default_rng(seed)
    pillars = [room(x, y, x + 0.4, y + 0.3)[::-1, ::-1] for x, y in ((1.0, 1.0), (2.5, 0.7), (1.2, 2.6))]
    faces = np.concatenate([room(0.0, 0.0, 4.0, 4.0), *pillars])
    pose = np.array([*rng.uniform(2.0, 2.4, 2), rng.uniform(-np.pi, np.pi)])
    ranges, _ = RangeFinder(faces, LidarConfig(beams=36)).cast(pose)
    walls = shapely.MultiLineString(list(faces))
    for bearing, distance in zip(bearings(LidarConfig(beams=36)) + pose[2], ranges, strict=True):
        ray = shapely.LineString([pose[:2], pose[:2] + 4.0 * np.array([np.cos(bearing), np.sin(bearing)])])
        expected = shapely.Point(pose[:2]).distance(walls.intersection(ray))
        assert distance == pytest.approx(expected, abs=1e-7)


def test_no_beam_slips_through_the_joint_of_two_faces():
    ranges, face = RangeFinder(room(-1.0, -1.0, 1.0, 1.0), LidarConfig(beams=8)).cast(np.zeros(3))
    np.testing.assert_allclose(ranges, [1.0, np.sqrt(2), 1.0, np.sqrt(2)] * 2, rtol=1e-12)
    assert np.all(face >= 0)


def test_a_face_across_the_seam_is_one_wall():
    faces = np.array([[[-1.0, 3.0], [-1.0, -3.0]]])
    ranges, face = RangeFinder(faces, FULL).cast(np.zeros(3))
    assert np.array_equal(np.flatnonzero(face == 0), [*range(36), *range(145, 180)])
    np.testing.assert_allclose(ranges[face == 0], -1.0 / np.cos(bearings(FULL)[face == 0]), rtol=1e-12)


def test_faces_are_transparent_from_behind_and_a_face_without_length_is_ignored():
    faces = np.array([[[1.0, 1.0], [1.0, -1.0]], [[1.0, 0.0], [1.0, 0.0]]])
    assert np.all(RangeFinder(faces, FULL).cast(np.zeros(3))[1] == -1)


def test_an_empty_world_returns_nothing():
    ranges, face = RangeFinder(np.zeros((0, 2, 2)), FULL).cast(np.zeros(3))
    assert np.all(np.isposinf(ranges))
    assert np.all(face == -1)


def test_the_memory_of_cells_is_bounded():
    finder = RangeFinder(room(0.0, 0.0, 9.0, 9.0), LidarConfig(cells_max=3))
    for x in np.arange(0.5, 9.0, 1.0):
        finder.cast(np.array([x, 0.5, 0.0]))
        assert len(finder._cells) <= 3


def test_bearings_of_a_full_turn_do_not_repeat_its_end_and_those_of_a_half_turn_hold_both_ends():
    np.testing.assert_allclose(np.rad2deg(bearings(FULL)), np.arange(-180.0, 180.0, 2.0))
    np.testing.assert_allclose(np.rad2deg(bearings(HALF)), np.arange(-90.0, 91.0))


def test_noise_is_radial_and_measurements_beyond_the_maximum_are_none_and_those_below_0_tell_nothing():
    ranges = np.array([1.0, 3.995, 3.995, np.inf, 0.01])
    measured = noisy(ranges, 0.01, np.array([2.0, 1.0, -1.0, 0.0, -2.0]))
    np.testing.assert_allclose(measured, [1.02, np.inf, 3.985, np.inf, np.nan])


def test_noise_that_grows_with_the_range_has_the_stated_standard_deviation_at_each_range():
    config = LidarConfig(sigma_m=0.01, sigma_share=0.02)
    assert beam_sigmas(np.array([1.0]), LidarConfig()) == 0.01
    np.testing.assert_allclose(beam_sigmas(np.array([0.5, 2.0, np.inf]), config), [0.01 * 2**0.5, 0.01 * 17**0.5, 0.01])
    scan = Scan(bearings(config)[:3], np.array([0.5, 2.0, np.inf]), 0.01, 4.0, 0.0, 0.02)
    np.testing.assert_allclose(scan.sigmas_m, beam_sigmas(scan.ranges_m, config))


def test_an_impossible_field_of_view_is_refused():
    with pytest.raises(ValueError, match="at most a full turn"):
        RangeFinder(np.zeros((0, 2, 2)), LidarConfig(fov_rad=7.0))
