"""That two lines are one, as a measurement: against derivatives taken numerically."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.backends.kalman.linear import equality
from chainslam.slam.geometry.poses import wrap


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32))
def test_e_is_how_far_the_second_line_is_off_the_first_about_its_anchor_and_h_minus_its_derivative(seed):
    rng = np.random.default_rng(seed)
    x, anchors = np.concatenate([rng.uniform(-9, 9, 3), rng.uniform(-1.5, 1.5, 4)]), rng.uniform(-9, 9, (2, 2))
    x[5] = rng.choice([x[3], wrap(x[3] + np.pi - 0.1), wrap(x[3] - np.pi + 0.1)])

    def off(x):
        n = np.array([np.cos(x[5]), np.sin(x[5])])
        return np.array([wrap(x[5] - x[3]), x[6] + n @ (anchors[1] - anchors[0]) - x[4]])

    def slope(x):
        return np.stack([(off(x + d) - off(x - d)) / 2e-6 for d in 1e-6 * np.eye(7)], axis=-1)

    H, e = equality(x[3:].reshape(2, 2), anchors)
    np.testing.assert_allclose(e, off(x), atol=1e-12)
    np.testing.assert_allclose(H, -slope(x), atol=1e-7)
    alpha = rng.uniform(-3, 3)
    H, same = equality(x[3:].reshape(2, 2), anchors, alpha)
    np.testing.assert_array_equal(same, e)
    np.testing.assert_allclose(H, -slope(np.where(np.arange(7) == 5, alpha, x)), atol=1e-7)
    assert H[1, 5] != pytest.approx(0.0, abs=1e-12)
