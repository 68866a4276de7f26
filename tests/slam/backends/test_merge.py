"""Merging two lines is conditioning on their equality: against dense algebra, for every back end."""

import numpy as np
import pytest

from chainslam.slam.backends import BACKENDS
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.robot import Odometry

every_back_end = pytest.mark.parametrize("name", list(BACKENDS))
START, P0 = np.array([12.0, -7.0, 0.4]), np.diag([0.02, 0.02, 0.004]) ** 2


def wall(r, t0, noise):
    """Return a line ahead of the robot seen at `t0` along it, its covariance and its centre, robot frame."""
    turn = np.array([[1.0, 0.0], [t0, 1.0]])
    cov = turn @ np.diag([0.006**2, 0.004**2]) @ turn.T
    return np.array([0.0, r]) + np.linalg.cholesky(cov) @ noise, cov, np.array([r, t0])


def two_of_one_wall(name):
    """Return a back end that entered one wall as two landmarks, from two places, and another wall between."""
    rng = np.random.default_rng(21)
    backend = BACKENDS[name].make(START.copy(), P0.copy())

    def enter(r, t0):
        line, cov, centre = wall(r, t0, rng.standard_normal(2))
        return int(backend.grow(line[None], cov[None], centre[None])[0])

    keep = enter(2.0, -1.0)
    other = int(backend.grow(np.array([[1.2, 1.5]]), 1e-5 * np.eye(2)[None], np.array([[0.5, 1.4]]))[0])
    backend.predict(Odometry(np.array([0.1, 0.0, 0.0]), np.diag([0.005, 0.005, 0.005]) ** 2))
    drop = enter(1.9, 1.5)
    return backend, keep, other, drop


def conditioned(joint):
    """Condition (pose, keep, other, drop) on keep and drop being one line: by information, with a stiff spring.

    The derivative of the constraint is taken at the mean, numerically.
    """
    mean, anchors = joint.mean, joint.anchors

    def difference(x):
        alpha = x[7]
        at_keep = x[8] + np.array([np.cos(alpha), np.sin(alpha)]) @ (anchors[2] - anchors[0])
        return np.array([wrap(x[3] - alpha), x[4] - at_keep])

    step = 1e-6
    A = np.stack([(difference(mean + d) - difference(mean - d)) / (2 * step) for d in step * np.eye(9)], axis=-1)
    gain = np.linalg.solve(A @ joint.cov @ A.T, A @ joint.cov).T
    return mean - gain @ difference(mean), joint.cov - gain @ A @ joint.cov


@pytest.mark.parametrize("name", [name for name, entry in BACKENDS.items() if entry.covariance != "bound"])
def test_merging_is_conditioning_on_equality_and_reports_the_line_about_the_anchor_kept(name):
    """A bound has no correlations to condition on."""
    backend, keep, other, drop = two_of_one_wall(name)
    joint = backend.belief.joint([keep, other, drop])
    mean, cov = conditioned(joint)
    backend.merge(keep, drop)
    assert backend.belief.ids.tolist() == [keep, other]
    after = backend.belief.joint([keep, other])
    np.testing.assert_array_equal(after.anchors, joint.anchors[:2])
    sigma = np.sqrt(np.diag(cov)[:7])
    # Who learns nothing of where the world lies takes its Jacobians elsewhere: equal to first order only.
    close = 0.05 if BACKENDS[name].keeps_frame else 1e-4
    np.testing.assert_allclose((after.mean - mean[:7]) / sigma, 0.0, atol=close)
    np.testing.assert_allclose((after.cov - cov[:7, :7]) / np.outer(sigma, sigma), 0.0, atol=close)


@every_back_end
def test_merging_leaves_the_covariance_sound_and_its_volume_smaller(name):
    backend, keep, other, drop = two_of_one_wall(name)
    before = backend.belief.joint([keep, other]).cov
    backend.merge(keep, drop)
    after = backend.belief.joint([keep, other]).cov
    np.testing.assert_allclose(after, after.T, atol=1e-18)
    assert np.linalg.eigvalsh(after).min() > 0
    if BACKENDS[name].covariance == "bound":  # Two lines that may err alike tell it nothing.
        assert np.trace(after) < np.trace(before) * (1.0 + 1e-8)
    else:
        assert np.linalg.slogdet(after)[1] < np.linalg.slogdet(before)[1]


@every_back_end
def test_merging_a_line_with_its_twin_again_and_again_stays_sound(name):
    """Two entries of one observation are equal but for its noise; after many merges nothing becomes indefinite."""
    rng = np.random.default_rng(22)
    backend, keep, other, drop = two_of_one_wall(name)
    backend.merge(keep, drop)
    for _ in range(30):
        line, cov, centre = wall(1.9, 0.3, rng.standard_normal(2))
        new = int(backend.grow(line[None], cov[None], centre[None])[0])
        backend.merge(keep, new)
        P = backend.belief.joint([keep, other]).cov
        scale = np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 0
