"""What a factor graph is linearised by, against numerical derivatives and the model of the filters."""

import gtsam
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.backends.graph.ahead import Ahead
from chainslam.slam.backends.graph.factors import line_factors, line_key, odometry_factor, plane, pose3, pose_key
from chainslam.slam.backends.graph.record import Observation
from chainslam.slam.estimation.models import innovations
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import compose, inverse, rotation
from chainslam.slam.robot import Odometry

few = settings(max_examples=20, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)


def spread(size, rng, scale=0.01):
    A = rng.standard_normal((size, size))
    return scale**2 * (A @ A.T + np.eye(size))


def slopes(f, size, step=1e-6):
    """Return the derivative of f at zero by central differences."""
    return np.stack([(f(e) - f(-e)) / (2 * step) for e in step * np.eye(size)], axis=-1)


@few
@given(seed=seeds)
def test_a_joint_carried_ahead_spreads_as_its_errors_move_it(seed):
    rng = np.random.default_rng(seed)
    pose, motions = rng.uniform(-3, 3, 3), rng.uniform(-0.5, 0.5, (3, 3))
    lines, anchors = rng.uniform(-3, 3, (2, 2)), rng.uniform(-5, 5, (2, 2))
    cov, covs = spread(7, rng), [spread(3, rng) for _ in motions]

    def at(errors):
        """Return pose ahead and lines (alpha, d) where pose (body frame), lines (alpha, r) and motions err."""
        here = np.array([*(pose[:2] + rotation(pose[2]) @ errors[:2]), pose[2] + errors[2]])
        for k, motion in enumerate(motions):
            here = compose(here, motion + errors[7 + 3 * k : 10 + 3 * k])
        alpha, r = (lines + errors[3:7].reshape(2, 2)).T
        d = r - np.sum(normals(alpha) * anchors, axis=-1)
        return np.concatenate([here, np.stack([alpha, d], axis=-1).ravel()])

    ahead = Ahead(pose, [Odometry(motion, cov) for motion, cov in zip(motions, covs, strict=True)])
    dense = np.zeros((16, 16))
    dense[:7, :7] = cov
    for k, block in enumerate(covs):
        dense[7 + 3 * k : 10 + 3 * k, 7 + 3 * k : 10 + 3 * k] = block
    D = slopes(at, 16)
    np.testing.assert_allclose(ahead.pose, at(np.zeros(16))[:3], atol=1e-12)
    np.testing.assert_allclose(ahead.cov(cov, lines, anchors), D @ dense @ D.T, rtol=1e-5, atol=1e-11)


@few
@given(seed=seeds)
def test_a_motion_errs_in_the_frame_before_it(seed):
    rng = np.random.default_rng(seed)
    motion, cov = rng.uniform(-1, 1, 3), spread(3, rng)
    weights = odometry_factor(1, Odometry(motion, cov)).noiseModel().information()
    rows = np.ix_((4, 5, 0), (4, 5, 0))
    D = slopes(lambda e: compose(inverse(motion), motion + e), 3)
    np.testing.assert_allclose(np.linalg.inv(weights[rows]), D @ cov @ D.T, rtol=1e-5, atol=1e-11)


@few
@given(seed=seeds)
def test_the_factors_of_an_observation_are_the_innovation_of_the_filters(seed):
    """However far the line is turned: nothing of it was linearised beforehand, but for the sine of the angle."""
    rng = np.random.default_rng(seed)
    pose, line = rng.uniform(-3, 3, 3), np.array([rng.uniform(-3, 3), rng.uniform(-5, 5)])
    seen = np.array([line[0] - pose[2] + rng.uniform(-0.5, 0.5), rng.uniform(1, 4)])
    t0, along, across = rng.uniform(-3, 3), *rng.uniform(0.001, 0.02, 2) ** 2
    cov = along * np.array([[1.0, t0], [t0, t0 * t0 + across / along]])
    model = innovations(pose, np.zeros((1, 2)), line[None], seen[None], cov[None])
    (expected,), sigmas = model.e, np.sqrt(np.diag(model.R[0]))
    values = gtsam.Values()
    values.insert(pose_key(4), pose3(pose))
    values.insert(line_key(7), gtsam.OrientedPlane3(plane(*line)))
    observation = Observation(4, (*seen, cov[0, 0], cov[0, 1], cov[1, 1]), epsilon=expected[0])
    direction, distance = (factor.whitenedError(values) for factor in line_factors(7, observation))
    np.testing.assert_allclose(direction, [-np.sin(expected[0]) / sigmas[0], 0.0, 0.0], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(distance, [expected[1] / sigmas[1], 0.0, 0.0], rtol=1e-6, atol=1e-6)
