"""Split covariance intersection: a bound whatever the correlations are, and next to the least one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from chainslam.slam.backends.blocks.intersection_ekf import IntersectionMap
from chainslam.slam.estimation.models import Initialisation, Linear, Motion

few = settings(max_examples=15, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)


def unrelated(lines):
    """Return new lines whose error has nothing of the pose's."""
    none = np.zeros((lines, 2))
    return Initialisation(none, none, np.zeros((lines, 2, 3)), np.tile(np.eye(2), (lines, 1, 1)))


def blocks(rng, lines=3):
    """Return a map of blocks that knows nothing of their correlations, and what its parts truly err like together."""
    size = 3 + 2 * lines
    root = np.concatenate([rng.standard_normal((size, 2)), 0.3 * rng.standard_normal((size, size))], axis=1)
    true = root @ root.T
    map_ = IntersectionMap(np.zeros(3), true[:3, :3])
    rows = np.arange(lines)
    covs = true[3:, 3:].reshape(lines, 2, lines, 2)[rows, :, rows, :]
    map_.append(unrelated(lines), covs)
    fresh = np.diag(rng.uniform(0.1, 1.0, 3))
    map_.move(Motion(np.zeros(3), np.eye(3), np.eye(3)), fresh)
    true[:3, :3] += fresh
    noise = rng.standard_normal((2 * lines, 2 * lines))
    H = rng.standard_normal((2 * lines, size))
    return map_, true, Linear(rows, H, np.zeros(2 * lines), 0.1 * np.eye(2 * lines) + 0.1 * noise @ noise.T)


def gain_of(map_, model, make):
    """Return how an update moves pose and lines with e, (s, k): it is linear in e."""
    rows = []
    for e in 1e-3 * np.eye(len(model.e)):
        moved = make()
        moved.condition(Linear(model.rows, model.H, e, model.R))
        rows.append(moved.joint(model.rows).mean / 1e-3)
    return np.array(rows).T


@few
@given(seed=seeds)
def test_blocks_by_intersection_bound_the_error_whatever_the_correlations_are(seed):
    map_, true, model = blocks(np.random.default_rng(seed))
    K = gain_of(map_, model, lambda: blocks(np.random.default_rng(seed))[0])
    rest = np.eye(len(true)) - K @ model.H
    error = rest @ true @ rest.T + K @ model.R @ K.T
    map_.condition(model)
    told = map_.joint(model.rows).cov
    for part in (slice(0, 3), slice(3, 5), slice(5, 7), slice(7, 9)):
        assert np.linalg.eigvalsh(told[part, part] - error[part, part]).min() > -1e-9 * np.trace(error)


@pytest.mark.parametrize("seed", range(4))
def test_weights_of_the_intersection_leave_next_to_the_least_trace(seed):
    map_, _, model = blocks(np.random.default_rng(seed))
    parts = [slice(0, 3), slice(3, 5), slice(5, 7), slice(7, 9)]
    fresh = map_._fresh.copy()
    before = map_.joint(model.rows).cov
    map_.condition(model)
    after = map_.joint(model.rows).cov

    def trace(logs, part):
        weights = np.exp(logs - np.logaddexp.reduce(logs))
        P = before.copy()
        P[:3, :3] -= fresh
        for own, weight in zip(parts, weights, strict=True):
            P[own, own] /= weight
        P[:3, :3] += fresh
        gain = P @ model.H.T @ np.linalg.inv(model.H @ P @ model.H.T + model.R)
        rest = np.eye(len(P)) - gain @ model.H
        return np.trace((rest @ P @ rest.T + gain @ model.R @ gain.T)[part, part])

    for part in parts:
        least = min(
            minimize(trace, start, (part,), method="L-BFGS-B", bounds=[(-12.0, 0.0)] * 4).fun
            for start in (-np.ones(4), 3.0 * np.eye(4)[parts.index(part)] - 3.0)
        )
        assert np.trace(after[part, part]) < 1.03 * least
    assert np.array_equal(map_._fresh, np.zeros((3, 3)))


def test_walls_in_several_pieces_leave_an_update_that_can_be_solved():
    """Weights next to zero divide a wall's block; two pieces of one wall then differ by their noise alone.

    With a least weight of 1e-13 such a scan of an apartment ended in "Singular matrix".
    """
    for seed in range(200):
        rng = np.random.default_rng(seed)
        lines, seen = 6, np.array([0, 0, 1, 2, 3, 3, 4, 5])
        map_ = IntersectionMap(np.zeros(3), np.diag([3e-4, 4e-4, 6e-4]))
        covs = np.array([np.diag(10.0 ** rng.uniform([-5.3, -4.0], [-1.8, -3.4])) for _ in range(lines)])
        map_.append(unrelated(lines), covs)
        H, R = np.zeros((len(seen), 2, 3 + 2 * lines)), np.zeros(2 * len(seen))
        for k, row in enumerate(seen):
            H[k, 0, 2], H[k, 0, 3 + 2 * row], H[k, 1, 4 + 2 * row] = -1.0, 1.0, 1.0
            angle = rng.uniform(-np.pi, np.pi)
            H[k, 1, :2], H[k, 1, 2:4] = (-np.cos(angle), -np.sin(angle)), rng.uniform(-1, 1)
            H[k, 1, 3:5] = 0.0
            H[k, 1, 3 + 2 * row : 5 + 2 * row] = rng.uniform(-1, 1), 1.0
            R[2 * k : 2 * k + 2] = 10.0 ** rng.uniform([-6.0, -6.3], [-0.7, -4.0])
        map_.condition(Linear(np.arange(lines), H.reshape(-1, 3 + 2 * lines), np.full(2 * len(seen), 1e-3), np.diag(R)))
        assert np.linalg.eigvalsh(map_.joint(np.arange(lines)).cov)[0] > 0.0
