"""Split covariance intersection: a bound whatever the correlations are, and next to the least one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from chainslam.slam.backends.blocks.intersection_ekf import (
    LEAST_WEIGHT,
    LONGEST,
    IntersectionEkf,
    IntersectionMap,
    _extrapolated,
    _shares,
)
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.estimation.models import Initialisation, Linear, Motion
from chainslam.slam.robot import Odometry

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


def test_what_the_wheels_add_is_independent_until_anything_comes_to_share_it():
    rng = np.random.default_rng(5)
    map_ = IntersectionMap(np.zeros(3), np.eye(3))
    F, Q = rng.standard_normal((2, 3, 3)), np.stack([np.diag(rng.uniform(0.1, 1.0, 3)) for _ in range(2)])
    for one, noise in zip(F, Q, strict=True):
        map_.move(Motion(np.zeros(3), one, np.eye(3)), noise)
    np.testing.assert_allclose(map_._fresh, F[1] @ Q[0] @ F[1].T + Q[1])
    map_.append(unrelated(1), np.eye(2)[None])
    np.testing.assert_array_equal(map_._fresh, np.zeros((3, 3)))


def test_weights_add_up_to_one_and_none_is_zero():
    shares = _shares(np.array([[0.0, 0.0, 0.0], [1.0, 3.0, 4.0], [0.0, 2.0, 2.0]]))
    np.testing.assert_allclose(shares[:2], [[1 / 3, 1 / 3, 1 / 3], [0.125, 0.375, 0.5]])
    assert shares[2, 0] == pytest.approx(LEAST_WEIGHT)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-15)


def test_weights_are_led_on_row_by_row_to_where_their_rounds_lead():
    """Steps that shrink by a share lead to where they end, but for the longest; those at rest, or to and fro, stay."""
    goal = np.log([0.7, 0.2, 0.1])
    start, sure = np.array([0.5, -0.3, 0.2]), np.log([1.0, 1e-9, 1e-11])
    rows = [[goal + start, goal + 0.6 * start, goal + 0.36 * start]]
    rows += [[sure, sure, sure], [goal, goal + start, goal]]
    rows += [[40.0 * start, 36.0 * start, 32.4 * start], [goal, goal + 0.01 * start, goal + 0.0199 * start]]
    first, second, third = (np.exp(np.array(each)) for each in zip(*rows, strict=True))
    ends = np.array([goal, sure, goal, 0.0 * start, goal + (0.2 - LONGEST**2 * 1e-4) * start])
    found = np.log(_extrapolated(first, second, third))
    np.testing.assert_allclose(found - found[:, :1], ends - ends[:, :1], atol=1e-6)
    np.testing.assert_allclose(np.exp(found).sum(axis=1), 1.0)


def test_an_update_is_the_same_in_whichever_order_lines_are_seen_and_leaves_all_others_alone(make_walls):
    walls, ends = make_walls(7), []
    rows = np.array([5, 1, 3, 1, 6])
    for order in ([0, 1, 2, 3, 4], [4, 1, 2, 3, 0], [1, 3, 0, 4, 2]):
        rng = np.random.default_rng(6)
        backend = IntersectionEkf(np.array([0.2, -1.0, 0.3]), np.diag([0.02, 0.02, 0.01]) ** 2)
        ids = backend.grow(*walls.look(np.array([0.2, -1.0, 0.3]), np.arange(7), rng))
        backend.predict(Odometry(np.zeros(3), np.diag([0.02, 0.02, 0.02]) ** 2))
        before = backend.belief.joint(ids)
        lines, cov, _ = walls.look(np.array([0.21, -1.01, 0.31]), rows, rng)
        seen = Observations(ids[rows[order]], lines[order], cov[order])
        backend.update(seen, seen)
        ends.append(backend.belief.joint(ids))
        np.testing.assert_array_equal(ends[-1].mean, ends[0].mean)
        np.testing.assert_array_equal(ends[-1].cov, ends[0].cov)
    moved = ends[0].mean != before.mean
    assert moved[:3].all()
    assert moved[3::2].tolist() == moved[4::2].tolist() == [row in rows for row in range(7)]
    sigmas = np.sqrt(np.diag(before.cov))
    assert np.all(np.diag(ends[0].cov) <= np.diag(before.cov) * (1 + 1e-9))
    assert np.abs((ends[0].mean - before.mean) / sigmas).max() < 3.0
