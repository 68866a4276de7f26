"""The loops of the factor graph against numerical derivatives and dense matrices."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.backends.graph.ahead import Ahead
from chainslam.slam.backends.graph.kernels import cov_world, guess, joint_ahead, moved_lines, odometry_noise
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import compose, inverse, rotation, to_robot, to_world, wrap

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
def test_a_pose_carried_ahead_spreads_as_its_errors_move_it(seed):
    rng = np.random.default_rng(seed)
    pose, motions = rng.uniform(-3, 3, 3), rng.uniform(-0.5, 0.5, (3, 3))
    cov, covs = spread(3, rng), [spread(3, rng) for _ in motions]

    def at(errors):
        """Return the pose ahead where the graph's pose errs in its body frame, and each motion errs."""
        here = np.array([*(pose[:2] + rotation(pose[2]) @ errors[:2]), pose[2] + errors[2]])
        for k, motion in enumerate(motions):
            here = compose(here, motion + errors[3 + 3 * k : 6 + 3 * k])
        return here

    ahead = Ahead(pose)
    for motion, motion_cov in zip(motions, covs, strict=True):
        ahead.move(motion, motion_cov)
    dense = np.zeros((12, 12))
    for k, block in enumerate([cov, *covs]):
        dense[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = block
    D = slopes(at, 12)
    np.testing.assert_allclose(ahead.pose, at(np.zeros(12)), atol=1e-12)
    np.testing.assert_allclose(ahead.F, D[:, :3], atol=1e-8)
    np.testing.assert_allclose(ahead.pose_cov(cov), D @ dense @ D.T, rtol=1e-6, atol=1e-12)


@few
@given(seed=seeds)
def test_the_noise_of_a_motion_in_the_frame_after_it(seed):
    rng = np.random.default_rng(seed)
    motion, cov = rng.uniform(-1, 1, 3), spread(3, rng)
    D = slopes(lambda e: compose(inverse(motion), motion + e), 3)
    np.testing.assert_allclose(odometry_noise(motion, cov), D @ cov @ D.T, rtol=1e-6, atol=1e-12)


@few
@given(seed=seeds, count=st.integers(1, 6))
def test_the_guess_is_a_gauss_newton_step_of_the_pose_alone(seed, count):
    rng = np.random.default_rng(seed)
    predicted, motion, motion_cov = rng.uniform(-2, 2, 3), rng.uniform(-0.2, 0.2, 3), spread(3, rng)
    lines = np.stack([rng.uniform(-np.pi, np.pi, count), rng.uniform(4, 6, count)], axis=-1)
    cov = np.stack([spread(2, rng) for _ in lines])
    seen = np.stack([lines[:, 0] - predicted[2], lines[:, 1] - normals(lines[:, 0]) @ predicted[:2]], axis=-1)
    seen += 0.02 * rng.standard_normal(seen.shape)
    t0 = cov[:, 0, 1] / cov[:, 0, 0]

    def errors(off):
        pose = predicted + off
        epsilon = seen[:, 0] - lines[:, 0] + pose[2]
        away = lines[:, 1] - normals(lines[:, 0]) @ pose[:2]
        return np.stack([epsilon, seen[:, 1] * np.cos(epsilon) - t0 * np.sin(epsilon) - away], axis=-1).ravel()

    epsilon = errors(np.zeros(3))[::2]
    across = (cov[:, 1, 1] - cov[:, 0, 1] * t0) * (np.cos(epsilon) - t0 * np.sin(epsilon) / seen[:, 1]) ** 2
    weight = np.diag(1.0 / np.stack([cov[:, 0, 0], across], axis=-1).ravel())
    turn = np.eye(3)
    turn[:2, :2] = rotation(predicted[2] - motion[2])
    D = slopes(errors, 3)
    information = D.T @ weight @ D + np.linalg.inv(turn @ motion_cov @ turn.T)
    step = -np.linalg.solve(information, D.T @ weight @ errors(np.zeros(3)))
    found = guess(predicted, motion, motion_cov, lines, seen, cov)
    np.testing.assert_allclose(found, predicted + step, rtol=1e-6, atol=1e-8)


@few
@given(seed=seeds)
def test_the_joint_in_the_world_is_that_of_the_graph_carried_ahead_in_its_frame(seed):
    rng = np.random.default_rng(seed)
    frame, pose, motion = rng.uniform(-3, 3, (3, 3))
    lines = np.stack([rng.uniform(-3, 3, 3), rng.uniform(-5, 5, 3)], axis=-1)
    anchors = rng.uniform(-5, 5, (3, 2))
    anchors_world = to_world(anchors, frame)
    inner, frame_cov = spread(9, rng), spread(3, rng)

    def at(errors):
        """Return pose ahead, alpha and d about fixed anchors of the world, where graph (body frame) and frame err."""
        of_frame = frame + errors[9:]
        here = np.array([*(pose[:2] + rotation(pose[2]) @ errors[:2]), pose[2] + errors[2]])
        alpha, r = (lines + errors[3:9].reshape(3, 2)).T
        about = to_robot(anchors_world, of_frame)
        d = r - np.sum(normals(alpha) * about, axis=-1)
        state = np.stack([alpha + of_frame[2], d], axis=-1).ravel()
        return np.concatenate([compose(of_frame, compose(here, motion)), state])

    ahead = Ahead(compose(frame, pose))
    ahead.move(motion, np.zeros((3, 3)))
    joint = joint_ahead(inner, ahead.F, lines, anchors)
    joint[:3, :3] = ahead.pose_cov(inner[:3, :3])
    state = at(np.zeros(12))
    means = state[3:].reshape(3, 2)
    root = np.linalg.cholesky(frame_cov)
    found = cov_world(frame, root, ahead.pose, np.ascontiguousarray(means), anchors_world, joint)
    both = np.zeros((12, 12))
    both[:9, :9], both[9:, 9:] = inner, frame_cov
    D = slopes(at, 12)
    np.testing.assert_allclose(found, D @ both @ D.T, rtol=1e-5, atol=1e-9)


def test_lines_move_by_their_charts_and_one_that_is_nowhere_is_told():
    lines, thresholds = np.array([[3.1, 2.0], [0.0, -1.0]]), np.array([0.005, 0.2])
    moved, astray, farthest = moved_lines(lines, np.array([-0.1, 7.0, 0.5, 0.001, 7.0, -0.1]), thresholds)
    np.testing.assert_allclose(moved, [[wrap(3.2), 1.5], [-0.001, -0.9]])
    np.testing.assert_allclose(astray, [20.0, 0.5])
    assert farthest == pytest.approx(0.1)
    for nowhere in (np.inf, np.nan):
        assert np.isnan(moved_lines(lines, np.array([0.0, 0.0, 0.0, 0.0, 0.0, nowhere]), thresholds)[2])
