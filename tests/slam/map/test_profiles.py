"""What the beams of many scans say of a break in a wall, and how far that puts its faces off the line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.estimation.backend import Belief
from chainslam.slam.estimation.shared import SharedConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.lines import directions
from chainslam.slam.map.kernels.profile_kernels import (
    breaks_of_beams,
    faces_off,
    keep_surest,
    misfits,
    places_between,
    surest,
    walked,
)
from chainslam.slam.map.profiles import Profiles
from chainslam.slam.map.records import Records
from chainslam.slam.robot import Scan
from tests.slam.map.scenes import SIGMA_M, WALL, bent, scans, stepped

WHOLE = np.array([[-3.0, 3.0]])
LINE = np.array([[np.pi / 2, 0.0]])


def belief_of(pose, off=(0.0, 0.0)):
    """Return a belief in one wall along y = 0, free side below, anchored at the origin; its line off by (rad, m)."""
    return Belief(pose, np.eye(3), np.array([WALL]), np.zeros((1, 2)), LINE + np.array(off), lambda ids: None)


def look(profiles, pose, scan, segments=None, off=(0.0, 0.0)):
    """Show a scan's segments to the sums, all as parts of the wall."""
    segments = extract(scan) if segments is None else segments
    profiles.see(belief_of(pose, off), scan, segments, np.tile(profiles._records.rows(np.array([WALL])), len(segments)))


def faces_of(profiles, extents):
    """Return how far the faces of all walls are off their lines, over what, and which walls are broken."""
    return faces_off(profiles._records.columns["broken"], extents)


def random_poses(rng, count, along_m=3.0):
    """Return poses before the wall, 0.5 to 2.5 m from it and so far along it."""
    return np.column_stack(
        [rng.uniform(-along_m, along_m, count), rng.uniform(-2.5, -0.5, count), rng.uniform(-3, 3, count)]
    )


def dense(scanned, place):
    """Return step and turn at a place, their information and the likelihood ratio, by one least squares of all scans.

    Each scan (along, across, sigma) has an offset and a slope of its own.
    """
    n = len(scanned)
    rows, right = [], []
    for k, (along, across, sigma) in enumerate(scanned):
        A = np.zeros((len(along), 2 * n + 2))
        A[:, 2 * k], A[:, 2 * k + 1] = 1.0, along
        A[:, -2], A[:, -1] = along > place, np.maximum(along - place, 0.0)
        rows.append(A / sigma[:, None])
        right.append(across / sigma)
    A, y = np.concatenate(rows), np.concatenate(right)
    found, chi2 = np.linalg.lstsq(A, y, rcond=None)[:2]
    without = np.linalg.lstsq(A[:, :-2], y, rcond=None)[1]
    return found[-2:], np.linalg.inv(np.linalg.inv(A.T @ A)[-2:, -2:]), float(without[0] - chi2[0])


def drawn(rng, low, high, count):
    sigma = rng.uniform(0.005, 0.02, count)
    return np.sort(rng.uniform(low, high, count)), sigma * rng.standard_normal(count), sigma


@pytest.mark.parametrize("seed", range(5))
def test_the_break_at_a_place_is_that_of_a_dense_least_squares(seed):
    """Of three walls at once, the second of which was not seen; far from their anchors."""
    rng = np.random.default_rng(seed)
    walls = {0: drawn(rng, 28, 32, 40), 2: drawn(rng, -9, -7, 25)}
    along, across, sigma = np.concatenate(list(walls.values()), axis=1)
    places, place_of = np.array([28.9, 30.0, 30.7, -8.2, -7.8]), np.repeat([0, 2], [3, 2])
    sums = breaks_of_beams(along, across, sigma, np.repeat([0, 2], [40, 25]), places, place_of)
    for k, place in enumerate(places):
        found, information, ratio = dense([walls[place_of[k]]], place)
        ss, st, tt = sums[:3, k]
        np.testing.assert_allclose([[ss, st], [st, tt]], information, rtol=1e-6)
        at, step, turn, likelihood = surest(np.ascontiguousarray(sums[:, k : k + 1]), 0.0)
        np.testing.assert_allclose([at, step, turn, likelihood], [0, *found, ratio], rtol=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_the_sums_of_scans_are_those_of_one_least_squares_of_all(seed):
    """Each scan is off by an offset and a slope of its own, which nobody knows: the robot's error, and the line's."""
    rng = np.random.default_rng(seed)
    scanned, place = [drawn(rng, -1.0, 1.5, 20) for _ in range(6)], np.array([0.2])
    one = np.zeros(20, dtype=np.int64)
    sums = sum(breaks_of_beams(*each, one, place, one[:1]) for each in scanned)
    moved = [(along, across + rng.normal() + rng.normal() * along, sigma) for along, across, sigma in scanned]
    again = sum(breaks_of_beams(*each, one, place, one[:1]) for each in moved)
    np.testing.assert_allclose(again, sums, rtol=1e-6, atol=1e-6)
    found, information, ratio = dense(moved, 0.2)
    np.testing.assert_allclose(surest(sums, 0.0)[1:], [*found, ratio], rtol=1e-6)
    np.testing.assert_allclose([[sums[0, 0], sums[1, 0]], [sums[1, 0], sums[2, 0]]], information, rtol=1e-6)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("true", [(0.02, 0.0), (0.0, 0.05), (0.03, -0.1)])
def test_a_break_has_a_step_and_a_turn_only_where_one_alone_explains_much_less(seed, true):
    """By dense least squares of each alone."""
    rng, place, least = np.random.default_rng(seed), 0.2, 20.0
    along, across, sigma = drawn(rng, -1.0, 1.5, 60)
    across = across + true[0] * (along > place) + true[1] * np.maximum(along - place, 0.0)
    one = np.zeros(60, dtype=np.int64)
    sums = breaks_of_beams(along, across, sigma, one, np.array([place]), one[:1])
    columns = np.column_stack([np.ones(60), along, along > place, np.maximum(along - place, 0.0)]) / sigma[:, None]
    left = {}
    for name, among in (("none", [0, 1]), ("step", [0, 1, 2]), ("turn", [0, 1, 3]), ("both", [0, 1, 2, 3])):
        found, chi2 = np.linalg.lstsq(columns[:, among], across / sigma, rcond=None)[:2]
        left[name] = float(chi2[0]), found[2:]
    at, step, turn, ratio = surest(sums, least)
    alone = min("step", "turn", key=lambda name: left[name][0])
    expected = {"step": [*left["step"][1], 0.0], "turn": [0.0, *left["turn"][1]]}[alone]
    if left[alone][0] - left["both"][0] > least:
        expected = left["both"][1]
    np.testing.assert_allclose([at, step, turn, ratio], [0, *expected, left["none"][0] - left["both"][0]], rtol=1e-6)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32))
def test_the_likeliest_break_is_kept_where_it_is_likely_enough(seed):
    """Each place by a dense solution; one of which beams tell no step from a turn has no break."""
    rng = np.random.default_rng(seed)
    begin, sums, likeliest, best = int(rng.integers(-9, 9)), np.zeros((5, rng.integers(1, 7))), np.zeros(5), 0.0
    for p in range(sums.shape[1]):
        root = rng.standard_normal((2, rng.integers(0, 4)))
        info = root @ root.T
        told = info @ rng.normal(0.0, 2.0, 2)
        sums[:, p] = info[0, 0], info[0, 1], info[1, 1], *told
        if root.shape[1] < 2 or np.linalg.det(info) <= 1e-6 * info[0, 0] * info[1, 1]:
            continue
        both = np.linalg.solve(info, told)
        if told @ both > max(best, 5.0):
            best, alone = told @ both, told**2 / np.diag(info)
            one = np.where(np.arange(2) == np.argmax(alone), told / np.diag(info), 0.0)
            found = both if best - max(alone) > 5.0 else one
            likeliest[:] = 0.05 * (begin + p), *found, 0.05 * begin, 0.05 * (begin + sums.shape[1] - 1)
    broken = rng.standard_normal(5)
    keep_surest(sums, begin, 0.05, 5.0, broken)
    np.testing.assert_allclose(broken, likeliest, rtol=1e-6)


@pytest.mark.parametrize("seed", range(9))
def test_segments_are_walked_wall_by_wall_with_the_free_side_on_the_left(seed):
    rng = np.random.default_rng(seed)
    rows, means = rng.integers(-1, 3, 12), rng.normal(size=(3, 2))
    ends = np.round(rng.uniform(-1.0, 1.0, (12, 2, 2)), 1)
    along = np.vecdot(ends.mean(axis=1), directions(means[rows, 0] - 0.3))
    expected = [k for k in np.lexsort((along, rows)) if rows[k] >= 0]
    assert walked(ends, rows, 0.3, means).tolist() == expected


def test_fewer_than_two_beams_beside_a_place_say_nothing_of_it():
    along, one = np.array([0.0, 0.1, 0.2, 0.3]), np.zeros(4, dtype=np.int64)
    across, sigma = np.array([0.0, 0.0, 0.02, 0.02]), np.full(4, 0.01)
    sums = breaks_of_beams(along, across, sigma, one, np.array([0.05, 0.15, 0.25]), one[:3])
    np.testing.assert_array_equal(sums.any(axis=0), [False, True, False])


def test_places_lie_between_the_first_and_the_last_beam_of_each_wall():
    place, of = places_between(np.array([-0.6, 0.1, 0.55, 0.26, 0.3, 1.2, 1.25]), np.array([0, 0, 0, 2, 2, 5, 5]), 0.25)
    np.testing.assert_array_equal(of, [0, 0, 0, 0, 0])
    np.testing.assert_array_equal(place, [-2, -1, 0, 1, 2])


def test_a_lone_beam_at_a_place_itself_has_none():
    place, of = places_between(np.array([45.0, -0.1, 0.1]), np.array([0, 1, 1]), 0.25)
    np.testing.assert_array_equal(of, [1])
    np.testing.assert_array_equal(place, [0])


@pytest.mark.parametrize("seed", range(4))
def test_a_face_is_off_by_twice_the_root_mean_square_of_both(seed):
    """By a line fitted to thousands of points of the two faces."""
    rng = np.random.default_rng(seed)
    low, high = rng.uniform(-4.0, -1.0), rng.uniform(1.0, 4.0)
    place, step, turn = rng.uniform(low, high), 0.05 * rng.normal(), 0.1 * rng.normal()
    at = np.linspace(low, high, 20_001)
    faces = step * (at > place) + turn * np.maximum(at - place, 0.0)
    off = faces - np.polynomial.Polynomial.fit(at, faces, 1)(at)
    found = misfits(np.array([[place, step, turn]]), np.array([[low, high]]))
    np.testing.assert_allclose(found, 4.0 * np.mean(off**2), rtol=5e-3)


@pytest.mark.parametrize("place", [-2.0, 2.0])
def test_a_break_beyond_the_ends_of_a_wall_puts_it_off_by_nothing(place):
    assert misfits(np.array([[place, 0.02, 0.1]]), np.array([[-1.0, 1.0]])) == 0.0


@pytest.mark.parametrize("faces", [bent(np.deg2rad(0.5), 0.4), bent(np.deg2rad(-0.8), 0.4), stepped(0.012, 1.5)])
def test_a_break_that_no_scan_shows_is_stated_as_far_off_as_it_puts_the_faces(faces):
    """Whatever the robot believes its pose and the line to be, and however little of the wall it counts as such now."""
    rng = np.random.default_rng(3)
    near = [face for face in faces if abs(face[0, 0] - face[1, 0]) > 0.5]
    for error, line in (((0.0, 0.0, 0.0), (0.0, 0.0)), ((0.02, -0.03, 0.01), (-0.005, 0.01))):
        records = Records()
        profiles, poses = Profiles(SharedConfig(), records), random_poses(rng, 500, 1.2)
        for pose, scan in zip(poses, scans(faces, poses, rng), strict=True):
            segments = extract(scan)
            (on_wall,) = np.nonzero(np.abs(np.sin(segments.lines[:, 0] + pose[2])) > 0.99)
            look(profiles, pose + np.array(error), scan, segments.take(on_wall), line)
        ((first, sums),) = records.columns["profile"]
        # Along a line of normal (0, 1) one walks towards -x.
        at = -SharedConfig().resolution_m * np.linspace(first + sums.shape[1] - 1, first, 5_001)
        true = np.select([(at >= min(f[:, 0])) & (at <= max(f[:, 0])) for f in near],
                         [np.interp(at, np.sort(f[:, 0]), f[np.argsort(f[:, 0]), 1]) for f in near])  # fmt: skip
        off = true - np.polynomial.Polynomial.fit(at, true, 1)(at)
        (found,), *_ = faces_of(profiles, np.array([[-1.0, 1.0]]))
        assert 0.5 < np.sqrt(found / (4.0 * np.mean(off**2))) < 1.5
        broken = records.columns["broken"]
        assert len(faces) == 2 or broken[0, 2] == 0.0  # of a step alone scans tell no turn
        longer = np.array([[0.05 * first - 1.0, 0.05 * (first + sums.shape[1] - 1) + 0.5]])
        off_m2, over, _ = faces_of(profiles, longer)
        assert off_m2 == pytest.approx(misfits(broken, longer)) != found
        np.testing.assert_array_equal(over, longer)


def test_a_wall_is_crooked_only_where_its_break_lies_between_its_ends():
    records = Records()
    profiles = Profiles(SharedConfig(), records)
    walls = records.rows(np.arange(4))
    records.columns["broken"][walls[1:]] = [[0.5, 0.02, 0, -2, 2], [0.5, 0, 0.1, -2, 2], [-2.0, 0.02, 0.1, -2, 2]]
    extents = np.array([[-1.0, 1.0]] * 4)
    assert faces_of(profiles, extents)[2].tolist() == [False, True, True, False]
    assert faces_of(profiles, extents - [[0.0, 0.6]])[2].tolist() == [False] * 4


@pytest.mark.parametrize("seed", range(3))
def test_a_straight_wall_is_never_broken(seed):
    rng = np.random.default_rng(seed)
    profiles, poses = Profiles(), random_poses(rng, 700)
    for pose, scan in zip(poses, scans(bent(0.0), poses, rng), strict=True):
        look(profiles, pose, scan)
        assert faces_of(profiles, WHOLE)[0] == 0.0


def test_a_beam_of_the_next_face_at_a_straight_walls_end_is_no_break():
    """In cml_Vipiteno2 44 beams of a wall of 7 m and one of a face of 0.1 m made a turn of 19 degrees of six sigmas."""
    profiles = Profiles()
    poses = np.column_stack([np.linspace(1.0, 0.0, 60), np.full(60, -1.0), np.zeros(60)])
    for pose, scan in zip(poses, scans(bent(0.0), poses, np.random.default_rng(5), 0.0), strict=True):
        segments = extract(scan)
        ranges = scan.ranges_m.copy()
        ranges[segments.beams[0, 1]] += 0.03
        look(profiles, pose, Scan(scan.bearings_rad, ranges, SIGMA_M, 4.0, 0.0), segments.take(np.array([0])))
    assert faces_of(profiles, WHOLE)[0] == 0.0


def test_two_segments_of_one_wall_tell_the_step_between_them():
    """Each lies on its own face and shows nothing by itself."""
    pose = np.array([0.0, -1.0, 0.3])
    (scan,) = scans(stepped(0.04, 1.5), [pose], np.random.default_rng(2))
    segments = extract(scan)
    on_wall = np.flatnonzero(np.abs(np.sin(segments.lines[:, 0] + pose[2])) > 0.99)
    assert len(on_wall) == 2
    alone, both = Profiles(), Profiles()
    look(alone, pose, scan, segments.take(on_wall[:1]))
    look(both, pose, scan, segments.take(on_wall))
    ends = np.array([[-1.4, 1.4]])
    assert faces_of(alone, ends)[0] == 0.0 < faces_of(both, ends)[0]


def test_what_was_seen_of_a_merged_wall_counts_where_it_lies():
    """Half of the scans were taken for another landmark, 0.6 m along: together they are as sure as one."""
    rng, shared = np.random.default_rng(4), SharedConfig()
    poses = random_poses(rng, 60)
    records, whole = Records(), Records()
    split, one = Profiles(shared, records), Profiles(shared, whole)
    for k, (pose, scan) in enumerate(zip(poses, scans(bent(np.deg2rad(0.7)), poses, rng), strict=True)):
        segments = extract(scan)
        ids, anchors, lines = np.array([WALL, WALL + 1]), np.array([[0.0, 0.0], [0.6, 0.0]]), np.tile(LINE, (2, 1))
        split.see(
            Belief(pose, np.eye(3), ids, anchors, lines, lambda ids: None),
            scan,
            segments,
            np.full(len(segments), records.rows(ids)[k % 2]),
        )
        look(one, pose, scan, segments)
    records.merge(WALL, WALL + 1, -0.6)
    assert records.ids.tolist() == [WALL]
    (first, sums), (other, all_sums) = records.columns["profile"][0], whole.columns["profile"][0]
    assert (first, sums.shape) == (other, all_sums.shape)
    np.testing.assert_allclose(sums, all_sums, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(records.columns["broken"], whole.columns["broken"], rtol=1e-4)
