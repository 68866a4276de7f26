"""The loops over kept scans against sorting and a dense solver."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from chainslam.explore.floor.carrying_kernels import carried, nearest
from chainslam.slam.geometry.poses import rotation


@settings(max_examples=60, deadline=None)
@given(
    arrays(np.int64, array_shapes(min_dims=2, max_dims=2, max_side=9), elements=st.integers(0, 6)),
    st.integers(min_value=1, max_value=4),
    st.integers(min_value=0, max_value=2**32),
)
def test_the_nearest_are_the_first_in_order(numbers, count, seed):
    distances, is_out = numbers.astype(float), np.random.default_rng(seed).random(numbers.shape[1]) < 0.3
    for row, found in zip(distances, nearest(distances, is_out, count), strict=True):
        order = [n for n in np.argsort(row, kind="stable") if not is_out[n]][:count]
        assert found.tolist() == order + [-1] * (count - len(order))


@pytest.mark.parametrize("seed", range(5))
def test_scans_are_carried_as_a_dense_solver_says(seed):
    rng, faith = np.random.default_rng(seed), 0.01
    poses, lengths = rng.uniform(-3.0, 3.0, (9, 3)), rng.uniform(0.0, 3.0, 9) * (rng.random(9) < 0.6)
    turn, shift = 0.1 * lengths * rng.normal(size=9), lengths[:, None] * rng.normal(size=(9, 2))
    roots = rng.normal(size=(9, 2, 2))
    normal = lengths[:, None, None] * np.einsum("kij,klj->kil", roots, roots)
    motion, there = np.zeros(3), poses[0, :2]
    for k, found in enumerate(carried(poses, lengths, turn, normal, shift, faith)):
        arm = poses[k, :2] - there
        as_one = motion[:2] + rotation(motion[2]) @ arm - arm
        motion = np.array([
            *np.linalg.solve(normal[k] + faith * np.eye(2), shift[k] + faith * as_one),
            (turn[k] + faith * motion[2]) / (lengths[k] + faith),
        ])  # fmt: skip
        there = poses[k, :2]
        np.testing.assert_allclose(found, poses[k] + motion, atol=1e-12)
