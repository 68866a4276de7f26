"""Whether two lines may be one: by the chi-square gate on their difference, whatever their anchors."""

import numpy as np

from chainslam.slam.estimation.backend import Joint
from chainslam.slam.map.merging import same_line


def pair(rng, turn=0.0, offset=0.0):
    """Return two lines of one wall about anchors 2 m apart, with errors drawn from a correlated covariance."""
    alpha = rng.uniform(-3, 3)
    n, t = np.array([np.cos(alpha), np.sin(alpha)]), np.array([-np.sin(alpha), np.cos(alpha)])
    at = rng.uniform(-20, 20, 2)
    anchors = np.stack([at, at + rng.uniform(-2, 2) * t + 0.1 * n])
    means = np.array([[alpha, 0.0], [alpha + turn, offset - n @ (anchors[1] - anchors[0])]])
    root = np.diag([0.1, 0.1, 0.02, 0.004, 0.01, 0.005, 0.01]) @ (np.eye(7) + 0.3 * rng.standard_normal((7, 7)))
    mean = np.concatenate([np.zeros(3), means.ravel()])
    return mean, root, anchors


def test_entries_of_one_wall_pass_the_gate_in_99_cases_of_100():
    rng, passed = np.random.default_rng(51), 0
    for _ in range(1500):
        mean, root, anchors = pair(rng)
        passed += same_line(Joint(mean + root @ rng.standard_normal(7), root @ root.T, anchors), 0.99)
    assert abs(passed / 1500 - 0.99) < 3 * np.sqrt(0.01 * 0.99 / 1500) + 1e-3


def test_the_two_faces_of_a_wall_are_never_one_line():
    rng = np.random.default_rng(52)
    for _ in range(100):
        mean, root, anchors = pair(rng, turn=np.pi)
        mean[6] = -mean[6]
        assert not same_line(Joint(mean, root @ root.T, anchors), 0.99)


def test_lines_that_differ_by_many_sigmas_are_two():
    rng = np.random.default_rng(53)
    for _ in range(100):
        mean, root, anchors = pair(rng, turn=0.3, offset=0.5)
        assert not same_line(Joint(mean, 0.05 * root @ root.T, anchors), 0.99)
