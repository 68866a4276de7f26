"""Motions one after the other as one, against finite differences."""

import numpy as np
import pytest

from chainslam.slam.geometry.poses import compose
from chainslam.slam.odometry.diagnosis import composed
from chainslam.slam.robot import Odometry


@pytest.mark.parametrize("seed", range(5))
def test_two_motions_as_one_are_as_unsure_as_finite_differences_tell(seed):
    rng = np.random.default_rng(seed)
    roots, motions = rng.normal(size=(2, 3, 3)), rng.normal(size=(2, 3))
    first, then = (Odometry(motion, root @ root.T) for motion, root in zip(motions, roots, strict=True))
    one, eps = composed(first, then), 1e-6
    steps = eps * np.eye(3)
    by_first = np.array(
        [compose(first.motion + d, then.motion) - compose(first.motion - d, then.motion) for d in steps]
    )
    by_then = np.array([compose(first.motion, then.motion + d) - compose(first.motion, then.motion - d) for d in steps])
    expected_cov = (by_first.T @ first.cov @ by_first + by_then.T @ then.cov @ by_then) / (2.0 * eps) ** 2
    np.testing.assert_allclose(one.motion, compose(first.motion, then.motion))
    np.testing.assert_allclose(one.cov, expected_cov, rtol=1e-6, atol=1e-6)
