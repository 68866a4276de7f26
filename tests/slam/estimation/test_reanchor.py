"""A line about another anchor is the same line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.estimation.models import reanchor

few = settings(max_examples=20, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
STEP = 1e-6


def normal(alpha):
    return np.array([np.cos(alpha), np.sin(alpha)])


def jacobian(function, at):
    return np.stack([(function(at + d) - function(at - d)) / (2 * STEP) for d in STEP * np.eye(len(at))], axis=-1)


@few
@given(seeds)
def test_another_anchor_describes_the_same_line_and_its_derivative_is_exact(seed):
    rng = np.random.default_rng(seed)
    mean, anchor, other = rng.uniform(-2, 2, 2), rng.uniform(-5, 5, 2), rng.uniform(-5, 5, 2)
    moved, D = reanchor(mean, anchor, other)
    n = normal(mean[0])
    assert moved[0] == mean[0]
    assert moved[1] + n @ other == pytest.approx(mean[1] + n @ anchor, abs=1e-12)
    np.testing.assert_allclose(D, jacobian(lambda m: reanchor(m, anchor, other)[0], mean), atol=1e-8)
    back, E = reanchor(moved, other, anchor)
    np.testing.assert_allclose(back, mean, atol=1e-12)
    np.testing.assert_allclose(D @ E, np.eye(2), atol=1e-12)
