"""Walls beside walls, against shapely and against each pair looked at by itself."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.poses import to_world, wrap
from chainslam.slam.map.kernels.merging_kernels import lying_along
from chainslam.slam.map.kernels.wall_kernels import distances, ends_world
from chainslam.slam.map.polylines.kernels.vertex_kernels import Bounds, bends, laid_across, on_segments

few = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
BOUNDS = Bounds(0.05, 0.2, 0.3, 0.15, 0.8, 0.4, 0.7)


def scene(seed, most=9):
    """Return directions and ends of walls near one line, so that many lie beside or behind each other."""
    rng = np.random.default_rng(seed)
    n = rng.integers(1, most)
    alpha = rng.normal(0.0, 0.15, n)
    t = np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1)
    start = np.column_stack([rng.normal(0.0, 0.1, n), rng.uniform(-2.0, 2.0, n)])
    return rng, alpha, np.stack([start, start + rng.uniform(0.1, 1.5, (n, 1)) * t], axis=1)


def axes(alpha):
    """Return the normal and the direction of a line."""
    return np.array([np.cos(alpha), np.sin(alpha)]), np.array([-np.sin(alpha), np.cos(alpha)])


@few
@given(seed=seeds)
def test_where_walls_begin_and_end_and_how_far_they_are(seed):
    rng = np.random.default_rng(seed)
    anchors, means = rng.uniform(-3.0, 3.0, (5, 2)), rng.uniform(-3.0, 3.0, (5, 2))
    extents, point = np.sort(rng.uniform(-2.0, 2.0, (5, 2)), axis=1), rng.uniform(-4.0, 4.0, 2)
    ends = ends_world(anchors, means, extents)
    for k in range(5):
        n, t = axes(means[k, 0])
        np.testing.assert_allclose(ends[k], anchors[k] + means[k, 1] * n + extents[k][:, None] * t, atol=1e-12)
    found = distances(point, ends)
    np.testing.assert_allclose(found, [shapely.LineString(one).distance(shapely.Point(point)) for one in ends])


@few
@given(seed=seeds)
def test_two_walls_make_a_bend_where_the_one_goes_on_from_the_other(seed):
    rng, alpha, ends = scene(seed)
    rows, ids = np.flatnonzero(rng.random(len(alpha)) < 0.8), 3 * np.arange(len(alpha)) + 1
    cut = rng.choice(ids, (3, 2))
    found, expected = bends(rows, ids, alpha, ends, cut, BOUNDS), []
    known = {frozenset(pair) for pair in cut.tolist()}
    for before in rows:
        n, t = axes(alpha[before])
        head, length = ends[before, 1], np.linalg.norm(np.diff(ends[before], axis=0))
        for after in rows:
            gap, across = t @ (ends[after, 0] - head), n @ (ends[after, 0] - head)
            turn = wrap(alpha[after] - alpha[before])
            is_cut = frozenset([ids[before], ids[after]]) in known
            near = -length < gap < (0.8 if is_cut else 0.3) and t @ (ends[after, 1] - head) > 0.0
            if before == after or not near or abs(across) >= 0.2 or abs(turn) >= 0.4:
                continue
            # The lines cross so far beyond the head.
            A = np.column_stack([t, -axes(alpha[after])[1]])
            crossing = np.linalg.solve(A, ends[after, 0] - head)[0]
            cross = min(gap, 0.0) - 0.3 < crossing < max(gap, 0.0) + 0.3
            point = head + (crossing if cross else 0.5 * gap) * t
            expected.append(([before, after], *point, abs(turn), cross, gap < -0.05, is_cut))
    assert found.rows.tolist() == [one[0] for one in expected]
    assert found.is_cut.tolist() == [one[6] for one in expected]
    told = np.column_stack([found.points_world, found.turn_rad, found.cross, found.overlap])
    np.testing.assert_allclose(told, np.array([one[1:6] for one in expected], float).reshape(-1, 5), atol=1e-9)


@few
@given(seed=seeds)
def test_a_bend_lies_on_a_segment_that_passes_over_it(seed):
    rng, alpha, ends = scene(seed)
    pose, points = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, (6, 2)) * [0.2, 2.0]
    normals_world = rng.normal(0.0, 0.4, 6)
    lines = np.column_stack([alpha - pose[2], np.zeros(len(alpha))])
    turn = np.array([[np.cos(pose[2]), -np.sin(pose[2])], [np.sin(pose[2]), np.cos(pose[2])]])
    on, bearings = on_segments(points, normals_world, pose, lines, (ends - pose[:2]) @ turn, BOUNDS)
    for b, point in enumerate(points):
        inner = turn.T @ (point - pose[:2])
        np.testing.assert_allclose(bearings[b], np.arctan2(inner[1], inner[0]))
        expected = False
        for k in range(len(alpha)):
            n, t = axes(alpha[k])
            along, length = t @ (point - ends[k, 0]), np.linalg.norm(np.diff(ends[k], axis=0))
            over = 0.05 < along < length - 0.05 and abs(n @ (point - ends[k, 0])) < 0.2
            expected |= over and abs(wrap(normals_world[b] - alpha[k])) < 0.4
        assert on[b] == expected


@few
@given(seed=seeds)
def test_a_wall_is_laid_across_a_bend_that_a_scan_shows(seed):
    rng, alpha, ends = scene(seed)
    seen_alpha, pose = np.sort(rng.normal(0.0, 0.3, 4)), rng.uniform(-1.0, 1.0, 3)
    t = np.stack([-np.sin(seen_alpha), np.cos(seen_alpha)], axis=-1)
    corners = np.concatenate([np.zeros((1, 2)), np.cumsum(rng.uniform(0.3, 0.8, (4, 1)) * t, axis=0)]) - [0.0, 1.0]
    seen = np.stack([corners[:-1], corners[1:]], axis=1)
    turn = np.array([[np.cos(pose[2]), -np.sin(pose[2])], [np.sin(pose[2]), np.cos(pose[2])]])
    lines, variances = np.column_stack([seen_alpha - pose[2], np.ones(4)]), rng.uniform(0.0, 0.01, 4)
    tentative = rng.random(4) < 0.2
    laid = laid_across(lines, variances, (seen - pose[:2]) @ turn, tentative, pose, alpha, ends, 4.0, BOUNDS)
    expected = np.zeros(len(alpha), bool)
    for k in range(4):
        after = (k + 1) % 4
        bend, between = seen_alpha[after] - seen_alpha[k], seen[after, 0] - seen[k, 1]
        sure = bend**2 > 4.0 * (variances[k] + variances[after]) and not (tentative[k] or tentative[after])
        if not sure or abs(bend) >= 0.7 or np.linalg.norm(between) >= 0.8:
            continue
        middle = seen[k, 1] + 0.5 * between
        for wall in range(len(alpha)):
            n, along = axes(alpha[wall])
            past = along @ (middle - ends[wall, 0]) > 0.15 and along @ (ends[wall, 1] - middle) > 0.15
            beside = abs(n @ (middle - ends[wall, 0])) < 0.2
            turned = abs(wrap(alpha[wall] - seen_alpha[k] - 0.5 * bend))
            expected[wall] |= past and beside and turned < 0.4
    assert laid.tolist() == expected.tolist()
    np.testing.assert_allclose(to_world((seen - pose[:2]) @ turn, pose), seen, atol=1e-12)


@few
@given(seed=seeds)
def test_walls_lie_along_each_other_within_the_shorter_ones_distance_from_the_longer_ones_line(seed):
    rng, alpha, ends = scene(seed, most=16)
    ids, trusted = np.cumsum(rng.integers(1, 3, len(alpha))), rng.random(len(alpha)) < 0.9
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)
    touched = np.unique(rng.integers(0, ids[-1] + 3, 3))
    pairs, beside = lying_along(ids, touched, trusted, alpha, ends, lengths, np.cos(0.3), 0.15)
    expected = []
    for one in range(len(alpha)):
        for other in range(one + 1, len(alpha)):
            shorter, longer = (one, other) if lengths[one] <= lengths[other] else (other, one)
            n, t = axes(alpha[longer])
            across = np.abs((ends[shorter] - ends[longer, 0]) @ n).max()
            low, high = (ends[shorter] - ends[longer, 0]) @ t
            overlap = min(lengths[longer] - low, high)
            ours = trusted[one] and trusted[other] and bool({ids[one], ids[other]} & set(touched))
            if ours and abs(alpha[one] - alpha[other]) < 0.3 and across <= 0.15 and overlap >= 0.15:
                expected.append(([one, other], lengths[shorter], across, overlap))
    assert pairs.tolist() == [one[0] for one in expected]
    np.testing.assert_allclose(beside, np.array([one[1:] for one in expected]).reshape(-1, 3), atol=1e-12)
