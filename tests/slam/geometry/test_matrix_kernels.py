"""Small matrices in loops against numpy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chainslam.slam.geometry.matrix_kernels import gain_of, squared_distance, whitening, wrapped
from chainslam.slam.geometry.poses import wrap


@pytest.mark.parametrize("size", [0, 1, 2, 7, 24])
def test_what_is_whitened_has_the_unit_covariance_and_its_gain_is_that_of_numpy(size):
    rng = np.random.default_rng(size)
    root, PHt = rng.standard_normal((size, size)), rng.standard_normal((5, size))
    S = root @ root.T + 0.1 * np.eye(size)
    W = whitening(S)
    np.testing.assert_array_equal(W, np.tril(W))
    np.testing.assert_allclose(W @ S @ W.T, np.eye(size), atol=1e-11)
    np.testing.assert_allclose(W.T @ W, np.linalg.inv(S), rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(gain_of(PHt, W), np.linalg.solve(S, PHt.T).T, rtol=1e-9, atol=1e-11)
    if size == 2:
        e = rng.standard_normal(2)
        assert squared_distance(*e, S[0, 0], S[0, 1], S[1, 1]) == pytest.approx(e @ np.linalg.solve(S, e))


@given(angle=st.floats(-100.0, 100.0))
def test_an_angle_is_wrapped_as_an_array_of_them_is(angle):
    assert wrapped(angle) == wrap(np.array([angle]))[0]
