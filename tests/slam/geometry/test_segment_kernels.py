"""Loops over points and segments against shapely."""

import numpy as np
import pytest
import shapely

from chainslam.slam.geometry.segment_kernels import lie_beside


@pytest.mark.parametrize("seed", range(6))
def test_points_beside_a_segment_that_faces_them_are_those_that_shapely_finds(seed):
    rng, reach, cosine = np.random.default_rng(seed), 0.4, np.cos(np.pi / 4)
    points, segments = rng.uniform(-3.0, 3.0, (300, 2)), rng.uniform(-3.0, 3.0, (9, 2, 2))
    segments[0, 1] = segments[0, 0]  # of no length
    turns, faces = rng.uniform(-np.pi, np.pi, 300), rng.uniform(-np.pi, np.pi, 9)
    distance = shapely.distance(shapely.points(points)[:, None], shapely.linestrings(segments))
    expected = ((distance <= reach) & (np.cos(turns[:, None] - faces) >= cosine)).any(axis=1)
    towards, into = (np.stack([np.cos(angle), np.sin(angle)], axis=-1) for angle in (turns, faces))
    assert 20 < expected.sum() < 280
    np.testing.assert_array_equal(lie_beside(points, towards, segments, into, reach, cosine), expected)
    assert not lie_beside(points, towards, np.zeros((0, 2, 2)), np.zeros((0, 2)), reach, cosine).any()
