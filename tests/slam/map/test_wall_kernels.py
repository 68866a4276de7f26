"""Walls beside walls, against shapely and against each pair looked at by itself."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.map.kernels.merging_kernels import lying_along
from chainslam.slam.map.kernels.wall_kernels import distances, ends_world, moved

few = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)


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
def test_walls_lie_along_each_other_within_the_shorter_ones_distance_from_the_longer_ones_line(seed):
    rng, alpha, ends = scene(seed, most=16)
    ids, tentative = np.cumsum(rng.integers(1, 3, len(alpha))), rng.random(len(alpha)) >= 0.9
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)
    touched, means = rng.integers(-1, ids[-1] + 3, 3), np.column_stack([alpha, alpha])
    extents = np.column_stack([np.zeros(len(alpha)), lengths])
    pairs, beside = lying_along(ids, touched, tentative, means, ends, extents, np.cos(0.3), 0.15)
    expected = []
    for one in range(len(alpha)):
        for other in range(one + 1, len(alpha)):
            shorter, longer = (one, other) if lengths[one] <= lengths[other] else (other, one)
            n, t = axes(alpha[longer])
            across = np.abs((ends[shorter] - ends[longer, 0]) @ n).max()
            low, high = (ends[shorter] - ends[longer, 0]) @ t
            overlap = min(lengths[longer] - low, high)
            ours = not (tentative[one] or tentative[other]) and bool({ids[one], ids[other]} & set(touched))
            if ours and abs(alpha[one] - alpha[other]) < 0.3 and across <= 0.15 and overlap >= 0.15:
                expected.append(([one, other], lengths[shorter], across, overlap))
    assert pairs.tolist() == [one[0] for one in expected]
    np.testing.assert_allclose(beside, np.array([one[1:] for one in expected]).reshape(-1, 3), atol=1e-12)


@few
@given(seed=seeds)
def test_how_far_the_lines_of_long_walls_have_moved_across_the_ends_they_were_placed_at(seed):
    rng = np.random.default_rng(seed)
    placed, means = rng.uniform(-3.0, 3.0, (2, 6, 2))
    anchors, extents = rng.uniform(-3.0, 3.0, (6, 2)), np.sort(rng.integers(-4, 5, (6, 2)) / 4.0, axis=1)
    placed[rng.random(6) < 0.3] = np.nan
    at = np.where(np.isnan(placed), means, placed)
    long = [k for k in range(6) if extents[k, 1] - extents[k, 0] >= 0.75]
    tell, ends, across = moved(placed, extents, anchors, means, 0.75)
    np.testing.assert_array_equal(placed, at)
    assert tell.tolist() == long
    for k, found, off in zip(long, ends, across, strict=True):
        n, t = axes(at[k, 0])
        np.testing.assert_allclose(found, anchors[k] + at[k, 1] * n + extents[k][:, None] * t, atol=1e-12)
        np.testing.assert_allclose(off, means[k, 1] - (found - anchors[k]) @ axes(means[k, 0])[0], atol=1e-12)
