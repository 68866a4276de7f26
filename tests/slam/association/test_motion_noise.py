"""NIS, and what innovations tell of the noise of the wheels: against draws, and against the dense likelihood."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from chainslam.slam.association.joint_compatibility import NO_NIS, seen_halfway
from chainslam.slam.association.motion_noise import (
    FACTORS,
    MotionInnovation,
    MotionNoise,
    gains_of,
    motion_root,
    surprise,
)
from chainslam.slam.estimation.backend import Joint, Observations
from chainslam.slam.estimation.models import lines_robot
from chainslam.slam.geometry.poses import rotation
from chainslam.slam.robot import Odometry

ANCHORS = np.array([[3.0, 1.0], [-1.0, 2.5], [0.5, -2.0]])
MEAN = np.concatenate([np.zeros(3), np.column_stack([[0.0, 1.9, -1.5], np.zeros(3)]).ravel()])
IDS = np.array([2, 5, 6])
NOISE = np.array([0.002, 0.001])
NOTHING = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))


def belief(rng):
    """A joint Gaussian of a pose and three lines, and the root of what the last motion added to it."""
    root = 2e-3 * rng.standard_normal((9, 9))
    G = np.diag([0.004, 0.002, 0.003]) @ rng.uniform(0.5, 1.0, (3, 3))
    cov = root @ root.T
    cov[:3, :3] += G @ G.T
    return Joint(MEAN, cov, ANCHORS), G


def observed(joint, rng, G=None, factor=1.0):
    """Lines seen from a state drawn from the belief, the motion's own part of it `factor` times as large."""
    state = rng.multivariate_normal(joint.mean, joint.cov)
    if G is not None:
        state[:3] += np.sqrt(factor**2 - 1.0) * G @ rng.standard_normal(3)
    lines = lines_robot(state[:3], ANCHORS, state[3:].reshape(-1, 2)) + rng.normal(0.0, NOISE, (3, 2))
    return Observations(IDS, lines, np.tile(np.diag(NOISE) ** 2, (3, 1, 1)))


def test_the_nis_of_honest_observations_is_of_a_chi_square_variable():
    """Poses and lines are drawn from the joint Gaussian, observations from their covariance."""
    rng = np.random.default_rng(11)
    joint, G = belief(rng)
    found = [surprise(seen_halfway(joint, IDS, observed(joint, rng)), G)[0] for _ in range(400)]
    squared = np.array([nis.squared for nis in found])
    assert {nis.dof for nis in found} == {6}
    assert squared.mean() == pytest.approx(6.0, abs=4.0 * np.sqrt(12.0 / 400))
    assert squared.var() == pytest.approx(12.0, rel=0.4)
    assert surprise(seen_halfway(joint, IDS, NOTHING), G) == (NO_NIS, None)


@pytest.mark.parametrize("seed", range(5))
def test_the_gain_in_likelihood_is_that_of_the_dense_gaussians(seed):
    rng = np.random.default_rng(seed)
    joint, G = belief(rng)
    seen = seen_halfway(joint, IDS, observed(joint, rng, G, 3.0))
    innovation = surprise(seen, G)[1]
    HG = seen.H_pose @ G
    stated = multivariate_normal.logpdf(seen.e, cov=seen.S)
    wider = [multivariate_normal.logpdf(seen.e, cov=seen.S + (f**2 - 1.0) * HG @ HG.T) for f in FACTORS]
    np.testing.assert_allclose(gains_of(innovation), np.array(wider) - stated, rtol=1e-6)


@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_what_a_scan_tells_of_the_motion_has_the_variance_of_its_noise(factor):
    rng = np.random.default_rng(3)
    joint, G = belief(rng)
    told = [surprise(seen_halfway(joint, IDS, observed(joint, rng, G, factor)), G)[1] for _ in range(600)]
    a, w = np.array([one.a for one in told]), np.array([one.w for one in told])
    expected = a * (1.0 + (factor**2 - 1.0) * a)
    np.testing.assert_allclose(np.mean(w**2 / expected, axis=0), 1.0, atol=4.0 * np.sqrt(2.0 / 600))


def noise_after(factor, scans, seed):
    """The noise that is believed in after so many scans, and at which scan it first was more than stated."""
    rng, noise, first = np.random.default_rng(seed), MotionNoise(), None
    for k in range(scans):
        a = rng.uniform(0.1, 0.9, 3)
        real = (factor / noise.factor) ** 2
        noise.see(MotionInnovation(a, rng.normal(0.0, np.sqrt(a * (1.0 + (real - 1.0) * a)))))
        first = k if first is None and noise.factor > 1.0 else first
    return noise, first


@pytest.mark.parametrize("seed", range(3))
def test_wheels_that_slip_as_stated_are_believed(seed):
    noise, first = noise_after(1.0, 3000, seed)
    odometry = Odometry(np.zeros(3), np.eye(3))
    assert first is None
    assert noise.believed(odometry) is odometry


@pytest.mark.parametrize("factor", [2.0, 3.0, 6.0])
def test_wheels_that_slip_more_are_found_out_within_fifty_scans_and_by_how_much(factor):
    for seed in range(5):
        noise, first = noise_after(factor, 400, seed)
        assert first < 50
        assert noise.factor == pytest.approx(factor, rel=0.6)
        np.testing.assert_allclose(noise.believed(Odometry(np.ones(3), np.eye(3))).cov, noise.factor**2 * np.eye(3))


@pytest.mark.parametrize("axes", [[0], [1], [2], [0, 1], [0, 2], [1, 2], [0, 1, 2], []])
@pytest.mark.parametrize("mixed", [False, True])
def test_the_root_of_a_motion_stands_in_the_world(axes, mixed):
    """Of a motion whose noise has all axes or only some of them, its own or any."""
    rng = np.random.default_rng(1)
    root = (rng.standard_normal((3, 3)) if mixed else np.diag([2.0, 0.5, 1.0]))[:, axes]
    odometry = Odometry(np.array([0.1, 0.0, 0.3]), root @ root.T)
    G = motion_root(odometry, 1.0)
    R = np.eye(3)
    R[:2, :2] = rotation(0.7)
    np.testing.assert_allclose(G @ G.T, R @ odometry.cov @ R.T, atol=1e-12)
