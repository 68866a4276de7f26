import warnings

import numpy as np
import pytest
from scipy.linalg import expm, solve
from scipy.stats import chi2, kstest

from chainslam.slam.estimation.backend import Joint
from chainslam.slam.evaluation.consistency import (
    _to_invariant,
    anees,
    bound_margins,
    chi2_band,
    joint_error,
    nees,
    nis,
    pooled_band,
    pose_covariances,
    pose_errors,
    share_in_band,
)
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import compose

RNG = np.random.default_rng(4)


def random_covs(n, d):
    roots = RNG.normal(size=(n, d, d))
    return roots @ np.swapaxes(roots, 1, 2) + 0.1 * np.eye(d)


def exp_of(xi):
    """The group's exponential by the matrix exponential, an independent slow truth."""
    return expm(np.array([[0.0, -xi[2], xi[0]], [xi[2], 0.0, xi[1]], [0.0, 0.0, 0.0]]))


def matrix(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def pose_of(transform):
    return np.array([transform[0, 2], transform[1, 2], np.arctan2(transform[1, 0], transform[0, 0])])


def test_nees_equals_the_quadratic_form_of_scipy():
    errors, covs = RNG.normal(size=(7, 4)), random_covs(7, 4)
    expected = [e @ solve(cov, e) for e, cov in zip(errors, covs, strict=True)]
    np.testing.assert_allclose(nees(errors, covs), expected, rtol=1e-10)
    np.testing.assert_allclose(nis(errors, covs), expected, rtol=1e-10)


def test_nees_is_that_of_filterpy():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a library that is held against ours, not of ours
        from filterpy.stats import NEES
    true, estimated, covs = RNG.normal(size=(9, 3)), RNG.normal(size=(9, 3)), random_covs(9, 3)
    expected = NEES(true[..., None], estimated[..., None], covs)
    np.testing.assert_allclose(nees(estimated - true, covs), np.ravel(expected), rtol=1e-10)


def test_nees_of_the_exact_model_is_chi_square():
    cov = random_covs(1, 3)
    errors = RNG.normal(size=(5000, 3)) @ np.linalg.cholesky(cov[0]).T
    values = nees(errors, np.repeat(cov, 5000, axis=0))
    assert kstest(values, "chi2", args=(3,)).pvalue > 1e-3
    assert anees(values, 3) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 3 / 5000))
    assert share_in_band(values, 3) == pytest.approx(0.95, abs=4 * np.sqrt(0.05 * 0.95 / 5000))


def test_a_covariance_that_is_not_positive_definite_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        nees(np.ones((1, 2)), np.array([[[1.0, 2.0], [2.0, 1.0]]]))


def test_the_band_is_the_tables():
    assert chi2_band(3) == pytest.approx((0.2158, 9.3484), abs=1e-4)
    low, high = chi2_band(3, runs=50)
    assert low < 3 < high
    assert high - low < 2.0


@pytest.mark.parametrize("turn", [0.0, 1e-9, 1e-3, 0.4, -2.5])
def test_the_pose_error_is_the_logarithm_on_the_left(turn):
    xi, true = np.array([0.3, -0.8, turn]), np.array([4.0, -7.0, 2.9])
    estimated = pose_of(exp_of(xi) @ matrix(true))
    np.testing.assert_allclose(pose_errors(estimated[None], true[None])[0], xi, atol=1e-12)


def test_the_pose_error_does_not_depend_on_where_the_robot_stands():
    xi = np.array([0.1, 0.2, -0.3])
    true = RNG.normal(size=(20, 3)) * 10
    estimated = np.stack([pose_of(exp_of(xi) @ matrix(pose)) for pose in true])
    np.testing.assert_allclose(pose_errors(estimated, true), np.tile(xi, (20, 1)), atol=1e-10)


def test_the_pose_covariance_moves_with_the_jacobian_of_the_error():
    pose, step = np.array([3.0, -2.0, 0.7]), 1e-6
    jacobian = np.stack([(pose_errors((pose + d)[None], pose[None])[0]) / step for d in step * np.eye(3)], axis=-1)
    cov = random_covs(1, 3)
    np.testing.assert_allclose(pose_covariances(pose[None], cov)[0], jacobian @ cov[0] @ jacobian.T, atol=1e-4)


def random_truth(lines=4):
    pose = np.array([5.0, -3.0, 0.4])
    anchors = pose[:2] + RNG.normal(size=(lines, 2)) * 3
    alpha = RNG.uniform(-3, 3, lines)
    r = np.sum(normals(alpha) * anchors, axis=-1) + 0.01 * RNG.normal(size=lines)
    return pose, anchors, np.stack([alpha, r], axis=-1)


def state_of(pose, anchors, lines):
    d = lines[:, 1] - np.sum(normals(lines[:, 0]) * anchors, axis=-1)
    return np.concatenate([pose, np.stack([lines[:, 0], d], axis=-1).ravel()])


def test_the_joint_error_has_the_stated_jacobian():
    pose, anchors, lines = random_truth()
    truth, step = state_of(pose, anchors, lines), 1e-6
    eye = np.eye(len(truth))

    def error(state):
        return joint_error(Joint(state, eye, anchors), pose, lines)[0]

    columns = [(error(truth + step * d) - error(truth - step * d)) / (2 * step) for d in eye]
    np.testing.assert_allclose(np.stack(columns, axis=-1), _to_invariant(pose, lines[:, 0], anchors), atol=1e-8)
    np.testing.assert_allclose(error(truth), 0.0, atol=1e-12)


def test_turning_and_shifting_the_estimated_world_shows_in_the_pose_error_alone():
    pose, anchors, lines = random_truth()
    motion = np.array([0.4, -0.2, 0.3])
    moved_pose, moved_anchors = compose(motion, pose), anchors @ matrix(motion)[:2, :2].T + motion[:2]
    alpha = lines[:, 0] + motion[2]
    moved_lines = np.stack([alpha, lines[:, 1] + normals(alpha) @ motion[:2]], axis=-1)
    state = state_of(moved_pose, moved_anchors, moved_lines)
    error, _ = joint_error(Joint(state, np.eye(len(state)), moved_anchors), pose, lines)
    np.testing.assert_allclose(error[3:], 0.0, atol=1e-12)
    assert np.abs(error[:3]).max() > 0.1


def test_the_joint_covariance_stays_positive_definite_and_a_robot_alone_is_its_special_case():
    pose, anchors, lines = random_truth()
    truth = state_of(pose, anchors, lines)
    cov = random_covs(1, len(truth))[0]
    _, moved = joint_error(Joint(truth, cov, anchors), pose, lines)
    assert np.linalg.eigvalsh(moved).min() > 0
    np.testing.assert_allclose(moved[:3, :3], pose_covariances(pose[None], cov[None, :3, :3])[0], atol=1e-12)


def test_knowing_nothing_new_about_the_world_stays_on_the_bound_and_knowing_more_falls_below():
    initial = np.diag([0.01, 0.01, 0.001])
    poses = np.column_stack([np.linspace(0, 5, 20), np.linspace(0, -3, 20), np.linspace(0, 2, 20)])
    A = np.tile(np.eye(3), (20, 1, 1))
    A[:, 0, 2], A[:, 1, 2] = -(poses[:, 1] - poses[0, 1]), poses[:, 0] - poses[0, 0]
    covs = A @ initial @ np.swapaxes(A, 1, 2)
    assert bound_margins(poses, covs, initial).min() == pytest.approx(0.0, abs=1e-12)
    assert bound_margins(poses, covs + 1e-3 * np.eye(3), initial).min() >= -1e-12
    assert bound_margins(poses, 0.99 * covs, initial).min() < -1e-3


@pytest.mark.parametrize("confidence", [0.95, 0.5])
def test_the_share_in_the_band_counts_its_ends_and_goes_by_its_confidence(confidence):
    low, high = chi2.ppf([0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence], 3)
    values = np.array([low - 1e-6, low + 1e-6, high - 1e-6, high + 1e-6, 0.0, 100.0, 2.0, 2.5])
    assert share_in_band(values, 3, confidence) == 0.5
    assert share_in_band(np.array(chi2_band(3, confidence)), 3, confidence) == 1.0


def test_the_pooled_band_counts_a_run_as_one_draw_however_many_steps_it_has():
    swings = np.array([1.0, -1.0] * 8)
    for runs, draws in (([np.full(9, 2.0)], 1), ([swings, np.full(9, 2.0)], 2), ([], 1), ([swings] * 20, 20)):
        low, high = chi2.ppf([0.05, 0.95], 3 * draws) / (3 * draws)
        assert pooled_band(runs, 3, 0.9) == pytest.approx((low, high), rel=1e-9)


def test_the_margin_is_the_least_eigenvalue_beyond_what_the_start_left_open():
    poses = np.array([[3.0, -2.0, 0.4], [5.0, 1.0, -0.3], [-4.0, 2.0, 2.0]])
    initial, covs = random_covs(1, 3)[0], random_covs(3, 3)
    covs[:, 0, 1] += 0.1  # an estimator's rounding may leave it so
    expected = []
    for pose, cov in zip(poses, covs, strict=True):
        A = np.eye(3)
        A[0, 2], A[1, 2] = -(pose[1] - poses[0, 1]), pose[0] - poses[0, 0]
        gap = cov - A @ initial @ A.T
        expected.append(
            min(np.linalg.eigvals(0.5 * (gap + gap.T)).real) / (initial[0, 0] + initial[1, 1] + initial[2, 2])
        )
    np.testing.assert_allclose(bound_margins(poses, covs, initial), expected, rtol=1e-9)


def test_the_covariance_of_the_joint_error_moves_with_its_derivative():
    pose, anchors, lines = random_truth()
    truth, step = state_of(pose, anchors, lines), 1e-6
    cov, eye = random_covs(1, len(truth))[0], np.eye(len(truth))
    columns = []
    for d in eye:
        ahead, behind = (joint_error(Joint(truth + s * step * d, eye, anchors), pose, lines)[0] for s in (1, -1))
        columns.append((ahead - behind) / (2 * step))
    jacobian = np.stack(columns, axis=-1)
    np.testing.assert_allclose(
        joint_error(Joint(truth, cov, anchors), pose, lines)[1], jacobian @ cov @ jacobian.T, atol=1e-5
    )
