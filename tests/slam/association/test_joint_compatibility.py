"""Observations taken together: conditioning on them, and which of them agree."""

import numpy as np
import pytest

from chainslam.slam.association.joint_compatibility import relocate, seen_halfway
from chainslam.slam.association.kernels.rest_kernels import compatible
from chainslam.slam.estimation.backend import Joint, Observations
from chainslam.slam.estimation.gates import gate_level, pair_levels
from chainslam.slam.estimation.models import innovations, lines_robot
from chainslam.slam.geometry.poses import wrap


def test_relocation_is_conditioning_in_information_form():
    """One of the lines is seen twice; all are seen so near to where they are expected that nothing is bent."""
    rng = np.random.default_rng(42)
    count = 6
    ids = np.array([2, 3, 5, 8, 9, 11])
    pose = np.array([3.0, -2.0, 0.7])
    alpha = rng.uniform(-3, 3, count)
    n = np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)
    anchors = pose[:2] + 2.0 * n + rng.uniform(-1, 1, (count, 2))
    mean = np.concatenate([pose, np.column_stack([alpha, np.sum(n * (pose[:2] + 2.0 * n - anchors), axis=-1)]).ravel()])
    root = 0.01 * rng.standard_normal((len(mean), len(mean)))
    joint = Joint(mean, root @ root.T + 1e-6 * np.eye(len(mean)), anchors)
    chosen = np.array([4, 1, 2, 1])
    lines = np.column_stack([wrap(alpha[chosen] - pose[2]), np.full(4, 2.0)]) + 1e-5 * rng.standard_normal((4, 2))
    cov = np.array([[[1e-4, 5e-5], [5e-5, 2e-4]]] * 4)

    def e(state):
        rows = state[3:].reshape(-1, 2)[chosen]
        return innovations(state[:3], anchors[chosen], rows, lines, cov).e.ravel()

    step = 1e-6
    H = -np.stack([(e(mean + d) - e(mean - d)) / (2 * step) for d in step * np.eye(len(mean))], axis=-1)
    R = innovations(pose, anchors[chosen], mean[3:].reshape(-1, 2)[chosen], lines, cov).R
    information = np.linalg.inv(joint.cov)
    innovation = e(mean)
    shift = np.zeros(len(mean))
    for k in range(4):
        rows = slice(2 * k, 2 * k + 2)
        information = information + H[rows].T @ np.linalg.inv(R[k]) @ H[rows]
        shift += H[rows].T @ np.linalg.solve(R[k], innovation[rows])
    found = relocate(joint, seen_halfway(joint, ids, Observations(ids[chosen], lines, cov)))
    expected = np.linalg.inv(information)
    np.testing.assert_allclose(found.cov, expected, atol=1e-8)
    np.testing.assert_allclose(found.mean, mean + expected @ shift, atol=1e-6)
    np.testing.assert_array_equal(found.anchors, anchors)


@pytest.mark.parametrize("slip_rad", [-0.05, 0.03, 0.1])
def test_relocation_finds_the_pose_after_a_slip_that_bends_its_measurements(slip_rad):
    """A tangent at the estimate would put the robot up to 12 mm beside its place and be sure of it to 1 mm."""
    anchors = np.array([[3.0, 1.0], [-1.0, 2.5], [0.5, -2.0]])
    alpha = np.array([0.0, 1.9, -1.5])
    mean = np.concatenate([np.zeros(3), np.column_stack([alpha, np.zeros(3)]).ravel()])
    joint = Joint(mean, np.diag([0.01, 0.01, 0.05, *[1e-4] * 6]) ** 2, anchors)
    true_pose = np.array([0.008, -0.006, slip_rad])
    lines = lines_robot(true_pose, anchors, mean[3:].reshape(-1, 2))
    beside = np.array([1.0, -0.5, 0.8])
    turn = np.array([[[1.0, 0.0], [t, 1.0]] for t in beside])
    cov = turn @ np.diag([0.002, 0.001]) ** 2 @ turn.swapaxes(1, 2)
    found = relocate(joint, seen_halfway(joint, np.arange(3), Observations(np.arange(3), lines, cov)))
    error = found.mean[:3] - true_pose
    assert error @ np.linalg.solve(found.cov[:3, :3], error) < 0.3


def test_relocation_by_nothing_is_no_relocation():
    joint = Joint(np.zeros(5), np.eye(5), np.ones((1, 2)))
    nothing = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    assert relocate(joint, seen_halfway(joint, np.array([5]), nothing)) is joint


def test_the_observation_that_the_others_contradict_is_dropped_though_alone_it_would_pass():
    """One error of 20 mm is common to four observations, each known to 1 mm in itself; one of them is 8 mm off."""
    shared, own = 0.02, 0.001
    S = shared**2 * np.kron(np.ones((4, 4)), np.eye(2)) + own**2 * np.eye(8)
    e = np.tile([0.03, 0.0], 4)
    e[4] += 0.008
    alone = [e[k : k + 2] @ np.linalg.solve(S[k : k + 2, k : k + 2], e[k : k + 2]) for k in range(0, 8, 2)]
    assert max(alone) < 9.2
    levels = gate_level(0.99, 2), pair_levels(0.99, 4)
    assert compatible(np.arange(4), e, S, *levels).tolist() == [0, 1, 3]
    assert compatible(np.array([0, 1, 3]), e, S, *levels).tolist() == [0, 1, 3]
