"""Textbook, iterated, unscented and intersection filters against slow algebra, optimisers and sampling."""

import runpy
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

import chainslam
from chainslam.slam.backends import BACKENDS, BackendOptions
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.backends.iterated_ekf import IteratedEkf
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.backends.oc_ekf import unseen
from chainslam.slam.backends.textbook_ekf import TextbookEkf
from chainslam.slam.backends.ukf import unscented
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.estimation.models import innovations, lines_robot
from chainslam.slam.geometry.poses import compose, wrap
from chainslam.slam.robot import Odometry

few = settings(max_examples=15, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
START, P0 = np.array([0.2, -1.0, 0.3]), np.diag([0.02, 0.02, 0.01]) ** 2
EXAMPLE = Path(__file__).parents[3] / "examples" / "own_backend.py"

pytestmark = pytest.mark.usefixtures("_unchecked")


def slope(function, x, step=1e-6):
    ahead, behind = (np.array([function(x + sign * d) for d in step * np.eye(len(x))]) for sign in (1, -1))
    difference = ahead - behind
    return (wrap(difference) if difference.shape[-1] == 2 else difference).T / (2 * step)


class Slow:
    """The EKF as it stands in textbooks, of (alpha, r), every derivative taken numerically."""

    def __init__(self):
        self.x, self.P = START.copy(), P0.copy()

    def predict(self, odometry):
        size = len(self.x)
        F, W = np.eye(size), np.zeros((size, 3))
        F[:3, :3] = slope(lambda pose: compose(pose, odometry.motion), self.x[:3])
        W[:3] = slope(lambda motion: compose(self.x[:3], motion), odometry.motion)
        self.x[:3] = compose(self.x[:3], odometry.motion)
        self.P = F @ self.P @ F.T + W @ odometry.cov @ W.T

    def grow(self, lines, cov, _):
        first = (len(self.x) - 3) // 2
        for line, noise in zip(lines, cov, strict=True):
            new = lambda x: lines_robot(np.array([*-rotated(x[:2], -x[2]), -x[2]]), np.zeros((1, 2)), x[None, 3:])[0]  # noqa: E731
            both = np.concatenate([self.x[:3], line])
            G = slope(new, both)
            size = len(self.x)
            A = np.zeros((size + 2, size))
            A[:size], A[size:, :3] = np.eye(size), G[:, :3]
            self.P = A @ self.P @ A.T
            self.P[size:, size:] += G[:, 3:] @ noise @ G[:, 3:].T
            self.x = np.concatenate([self.x, new(both)])
        return np.arange(first, first + len(lines))

    def update(self, _, seen):
        H, e, size = np.zeros((2 * len(seen), len(self.x))), np.zeros((len(seen), 2)), len(self.x)
        R = np.zeros((2 * len(seen), 2 * len(seen)))
        for k, row in enumerate(seen.ids.tolist()):
            columns = np.array([0, 1, 2, 3 + 2 * row, 4 + 2 * row])
            look = lambda x: lines_robot(x[:3], np.zeros((1, 2)), x[None, 3:])[0]  # noqa: E731
            H[2 * k : 2 * k + 2, columns] = slope(look, self.x[columns])
            e[k] = seen.lines[k] - look(self.x[columns])
            R[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = seen.cov[k]
        e[:, 0] = wrap(e[:, 0])
        gain = self.P @ H.T @ np.linalg.inv(H @ self.P @ H.T + R)
        self.x, self.P = self.x + gain @ e.ravel(), (np.eye(size) - gain @ H) @ self.P


def rotated(point, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ point


def test_the_textbook_filter_is_the_textbooks(make_walls):
    slow, filter_ = Slow(), TextbookEkf(START, P0)
    for backend in (slow, filter_):
        for _ in make_walls(8).tour(backend, START, np.random.default_rng(71), 30):
            pass
    joint = filter_.belief.joint(filter_.belief.ids)
    sigma = np.sqrt(np.diag(slow.P))
    off = joint.mean - slow.x
    off[2], off[3::2] = wrap(off[2]), wrap(off[3::2])
    # The one takes an observation's error where its piece lies, the other in (alpha, r): alike to first order.
    np.testing.assert_allclose(off / sigma, 0.0, atol=0.05)
    np.testing.assert_allclose((joint.cov - slow.P) / np.outer(sigma, sigma), 0.0, atol=0.05)


def lost(kind, walls, rng, count=5):
    """Return a filter that entered lines and then lost its way, what it sees now, and its belief before."""
    backend = kind(START, P0)
    ids = backend.grow(*walls.look(START, np.arange(count), rng))
    backend.predict(Odometry(np.array([0.1, 0.0, 0.05]), np.diag([0.05, 0.03, 0.08]) ** 2))
    true = compose(START, np.array([0.16, -0.02, 0.17]))
    lines, cov, _ = walls.look(true, np.arange(count), rng)
    return backend, Observations(ids, lines, cov), backend.belief.joint(ids)


@pytest.mark.parametrize("seed", range(5))
def test_the_iterated_filters_update_is_the_least_squares_solution(seed, make_walls):
    backend, seen, prior = lost(IteratedEkf, make_walls(8), np.random.default_rng([72, seed]))
    root = np.linalg.inv(np.linalg.cholesky(prior.cov))

    def at(x):
        return innovations(x[:3], prior.anchors, x[3:].reshape(-1, 2), seen.lines, seen.cov)

    backend.update(seen, seen)
    sigmas = np.sqrt(np.diagonal(at(backend.belief.joint(seen.ids).mean).R, axis1=1, axis2=2))
    found = least_squares(
        lambda x: np.concatenate([root @ (x - prior.mean), (at(x).e / sigmas).ravel()]), prior.mean, xtol=1e-14
    )
    after = backend.belief.joint(seen.ids)
    np.testing.assert_allclose(after.mean, found.x, atol=1e-6)
    cov = np.linalg.inv(found.jac.T @ found.jac)
    sigma = np.sqrt(np.diag(cov))
    np.testing.assert_allclose((after.cov - cov) / np.outer(sigma, sigma), 0.0, atol=1e-4)


def test_without_linearising_anew_the_iterated_filter_is_the_full_one(make_walls):
    ends = []
    for kind in (IteratedEkf, FullEkf):
        once = partial(kind, config=EkfConfig(relinearise=False))
        backend, seen, _ = lost(once, make_walls(8), np.random.default_rng(76))
        backend.update(seen, seen)
        ends.append(backend.belief.joint(seen.ids).mean)
    np.testing.assert_allclose(*ends, atol=1e-12)


def transformed(function, mean, cov):
    """The unscented transform of a whole state in one piece: mean, covariance and cross-covariance."""
    root = np.sqrt(3.0) * np.linalg.cholesky(cov).T
    up, down = (np.array([function(mean + sign * p) for p in root]) - function(mean) for sign in (1, -1))
    across = (root.T @ (up - down)) / 6
    return function(mean) + (up + down).sum(axis=0) / 6, (up.T @ up + down.T @ down) / 6, across


@few
@given(seed=seeds)
def test_points_of_what_a_function_needs_give_what_points_of_all_give(seed):
    """With what is needed first in the root, and of it the heading."""
    rng, size, needs = np.random.default_rng(seed), 11, 5
    root = 0.2 * rng.standard_normal((size, size))
    mean, cov = rng.standard_normal(size), root @ root.T
    weights = rng.standard_normal((needs, 3))

    def function(x):
        return np.sin(x[..., :needs] @ weights) + x[..., 2:3] ** 2

    spread = unscented(function, mean[:needs], cov[:needs, :needs])
    order = np.array([2, 0, 1, *range(3, size)])
    back = np.argsort(order)
    whole, whole_cov, across = transformed(lambda x: function(x[back]), mean[order], cov[np.ix_(order, order)])
    np.testing.assert_allclose(spread.mean, whole, atol=1e-12)
    np.testing.assert_allclose(spread.A @ cov[:needs, :needs] @ spread.A.T + spread.rest, whole_cov, atol=1e-12)
    np.testing.assert_allclose(cov[:, :needs] @ spread.A.T, across[back], atol=1e-12)


def test_unscented_motion_has_the_mean_and_the_spread_of_samples_where_a_jacobian_has_not():
    """Where the heading is known to 0.3 rad a metre ahead is 4.4 cm nearer on average."""
    cov, odometry = (
        np.diag([0.01, 0.01, 0.3]) ** 2,
        Odometry(np.array([1.0, 0.2, 0.1]), np.diag([0.02, 0.01, 0.05]) ** 2),
    )
    rng = np.random.default_rng(73)
    begin = START + rng.standard_normal((40_000, 3)) * np.sqrt(np.diag(cov))
    moved = odometry.motion + rng.standard_normal((40_000, 3)) * np.sqrt(np.diag(odometry.cov))
    ends = np.array([compose(pose, motion) for pose, motion in zip(begin, moved, strict=True)])
    off = {}
    for name in ("ukf", "full-ekf"):
        backend = BACKENDS[name].make(START, cov)
        backend.predict(odometry)
        off[name] = np.abs(backend.belief.pose_world - ends.mean(axis=0)).max()
        if name == "ukf":
            np.testing.assert_allclose(backend.belief.pose_cov, np.cov(ends.T), atol=0.003)
    assert off["ukf"] < 0.004 < 0.03 < off["full-ekf"]


def test_without_bend_the_unscented_filter_is_the_full_one(make_walls):
    """Small errors: the same drive ends within hundredths of a sigma."""
    ends = []
    for name in ("ukf", "full-ekf"):
        backend = BACKENDS[name].make(START, P0)
        for _ in make_walls(8, sigmas=(1e-4, 1e-4)).tour(
            backend, START, np.random.default_rng(74), 30, sigmas=(1e-4, 1e-4, 1e-4)
        ):
            pass
        ends.append(backend.belief.joint(backend.belief.ids))
    sigma = np.sqrt(np.diag(ends[1].cov))
    np.testing.assert_allclose((ends[0].mean - ends[1].mean) / sigma, 0.0, atol=0.02)
    np.testing.assert_allclose((ends[0].cov - ends[1].cov) / np.outer(sigma, sigma), 0.0, atol=0.02)


def test_a_filter_written_from_nothing_agrees_with_the_registrys(make_walls, monkeypatch):
    """That of the how-to: every sigma point of the whole state, in (alpha, r)."""
    monkeypatch.setattr(chainslam, "BACKENDS", {})
    own = runpy.run_path(str(EXAMPLE))["OwnUkf"](START, P0)
    ours = BACKENDS["ukf"].make(START, P0, BackendOptions(EkfConfig(at_wall=False)))
    ends = []
    for backend in (own, ours):
        for _ in make_walls(8).tour(backend, START, np.random.default_rng(75), 30):
            pass
        ends.append(backend.belief.joint(backend.belief.ids))
    sigma = np.sqrt(np.diag(ends[1].cov))
    np.testing.assert_allclose((ends[0].mean - ends[1].mean) / sigma, 0.0, atol=0.1)
    np.testing.assert_allclose((ends[0].cov - ends[1].cov) / np.outer(sigma, sigma), 0.0, atol=0.1)


@few
@given(seed=seeds)
def test_the_constrained_filter_leads_what_is_unseen_over_by_the_least_change(seed):
    """Of all D with D N = N+ the one nearest to I, in units of sigmas on the way in."""
    rng, backend = np.random.default_rng(seed), BACKENDS["oc-ekf"].make(START, P0)
    lines = np.stack([rng.uniform(-3, 3, 4), rng.uniform(1, 3, 4)], axis=-1)
    centres = lines[:, 1:] * np.stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])], axis=-1)
    backend.grow(lines, np.tile(np.diag([1e-4, 1e-5]), (4, 1, 1)), centres)
    map_ = backend.map
    position, alpha = map_.pose_world[:2], map_.means[:, 0]
    moved, turned = position + rng.uniform(-0.1, 0.1, 2), alpha + rng.uniform(-0.2, 0.2, 4)
    N, after = unseen(position, alpha, map_.anchors), unseen(moved, turned, map_.anchors)
    sigmas, taken = np.sqrt(map_.variances), []
    map_.follow = lambda moves, common: taken.append(np.eye(len(N)) + moves @ common.T)
    backend._carry((position, alpha), (moved, turned))
    np.testing.assert_allclose(taken[0] @ N, after, atol=1e-9)
    # The least D - I by Lagrange: rows in the span of N' W.
    change = (taken[0] - np.eye(len(N))) * sigmas
    others = np.linalg.svd((N / sigmas[:, None]).T)[2][3:]
    np.testing.assert_allclose(change @ others.T, 0.0, atol=1e-9)
