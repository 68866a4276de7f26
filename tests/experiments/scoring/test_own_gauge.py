import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.stats import chi2

from chainslam.experiments.scoring.own_gauge import own_gauge
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import J, rotation


def walls_of(rng, count=6):
    """Anchors, true lines (alpha, r) that pass near them, and a covariance of (alpha, d) that knows little of where."""
    anchors = rng.normal(size=(count, 2)) * 4.0
    alpha = rng.uniform(-3.0, 3.0, count)
    true = np.column_stack([alpha, np.sum(normals(alpha) * anchors, axis=1) + 0.01 * rng.normal(size=count)])
    own = 0.01 * rng.normal(size=(2 * count, 2 * count))
    common = motion_of_everything(alpha, anchors)
    cov = own @ own.T + 1e-6 * np.eye(2 * count) + common @ np.diag([0.2, 0.3, 0.02]) @ common.T
    return anchors, true, cov


def motion_of_everything(alpha, anchors):
    rows = np.zeros((2 * len(alpha), 3))
    rows[0::2, 2] = 1.0
    rows[1::2, :2] = normals(alpha)
    rows[1::2, 2] = np.sum(normals(alpha) * (anchors @ J.T), axis=1)
    return rows


def means_of(true, anchors):
    return np.column_stack([true[:, 0], true[:, 1] - np.sum(normals(true[:, 0]) * anchors, axis=1)])


def moved(anchors, means, shift, turn):
    """The same walls in a world that was turned about its origin, then shifted."""
    there = anchors @ rotation(turn).T + shift
    return there, np.column_stack([means[:, 0] + turn, means[:, 1]])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.floats(-3.0, 3.0), st.floats(-40.0, 40.0), st.floats(-40.0, 40.0))
@example(505126, -9e-162, -25.809669063446293, -6.785777959892087)  # About this least error undamped steps swing.
def test_turning_and_shifting_the_whole_map_changes_nothing_but_its_frame(seed, turn, x, y):
    rng = np.random.default_rng(seed)
    anchors, true, cov = walls_of(rng)
    means = means_of(true, anchors) + 0.003 * rng.normal(size=(len(true), 2))
    at_home = own_gauge(means, cov, anchors, true)
    there, means_there = moved(anchors, means, np.array([x, y]), turn)
    away = own_gauge(means_there, cov, there, true)  # (alpha, d) about anchors that move along
    assert away.squared == pytest.approx(at_home.squared, rel=1e-5, abs=1e-8)
    assert away.dof == at_home.dof == 2 * len(true) - 3


def test_the_frame_is_the_motion_that_was_made_and_what_it_does_to_the_middle_of_the_walls():
    anchors, true, cov = walls_of(np.random.default_rng(3))
    there, means = moved(anchors, means_of(true, anchors), np.array([7.0, -2.0]), 0.9)
    found = own_gauge(means, cov, there, true)
    np.testing.assert_allclose(found.frame_world, [7.0, -2.0, 0.9], atol=1e-8)
    assert found.squared == pytest.approx(0.0, abs=1e-9)
    assert found.shift_m == pytest.approx(np.hypot(*(there.mean(axis=0) - anchors.mean(axis=0))))


@pytest.mark.parametrize("seed", range(5))
def test_no_other_motion_leaves_less(seed):
    """scipy's least squares over the motion, on the plain formula of a moved line."""
    rng = np.random.default_rng(seed)
    anchors, true, cov = walls_of(rng)
    means = means_of(true, anchors) + 0.02 * rng.normal(size=(len(true), 2)) + [0.2, 0.0]
    root = np.linalg.inv(np.linalg.cholesky(cov))

    def left(motion):
        alpha = true[:, 0] + motion[2]
        n = np.column_stack([np.cos(alpha), np.sin(alpha)])
        d = true[:, 1] + n @ motion[:2] - np.sum(n * anchors, axis=1)
        return root @ np.column_stack([means[:, 0] - alpha, means[:, 1] - d]).ravel()

    best = least_squares(left, np.zeros(3), jac="3-point", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = own_gauge(means, cov, anchors, true)
    assert found.squared == pytest.approx(np.sum(left(found.frame_world) ** 2), rel=1e-9)
    assert found.squared == pytest.approx(2.0 * best.cost, rel=2e-3)
    for step in np.vstack([np.eye(3), -np.eye(3), rng.normal(size=(50, 3))]):
        assert found.squared < np.sum(left(found.frame_world + 1e-4 * step) ** 2)


def test_small_errors_part_into_that_of_the_shape_and_that_of_the_frame():
    rng = np.random.default_rng(9)
    anchors, true, cov = walls_of(rng)
    cov = 1e-10 * cov
    off = np.linalg.cholesky(cov) @ rng.normal(size=2 * len(true))
    found = own_gauge(means_of(true, anchors) + off.reshape(-1, 2), cov, anchors, true)
    assert found.squared + found.frame_squared == pytest.approx(off @ np.linalg.solve(cov, off), rel=1e-3)


def test_errors_as_stated_are_chi_square_however_little_is_known_of_the_frame():
    rng = np.random.default_rng(4)
    anchors, true, cov = walls_of(rng)
    common = motion_of_everything(true[:, 0], anchors)
    own = cov - common @ np.diag([0.2, 0.3, 0.02]) @ common.T
    root, frames = np.linalg.cholesky(own), np.diag([1e-4, 1e-4, 1e-6])
    stated = own + common @ frames @ common.T
    values, framed = [], []
    for _ in range(200):
        off = root @ rng.normal(size=len(own)) + common @ (np.sqrt(np.diag(frames)) * rng.normal(size=3))
        found = own_gauge(means_of(true, anchors) + off.reshape(-1, 2), stated, anchors, true)
        values.append(found.squared)
        framed.append(found.frame_squared)
    low, high = chi2.ppf([0.001, 0.999], 200 * found.dof) / 200
    assert low < np.mean(values) < high
    low, high = chi2.ppf([0.001, 0.999], 200 * 3) / 200
    assert low < np.mean(framed) < high


def test_a_frame_that_is_known_to_metres_and_ten_degrees_errs_as_stated():
    """The covariance has millimetres for the shape: beside the true walls, what it leaves free is no common motion."""
    rng = np.random.default_rng(8)
    anchors, true, _ = walls_of(rng, count=20)
    sigmas, framed = np.array([2.0, 3.0, 0.2]), []
    for _ in range(200):
        xi = sigmas * rng.normal(size=3)
        motion = expm(np.array([[0.0, -xi[2], xi[0]], [xi[2], 0.0, xi[1]], [0.0, 0.0, 0.0]]))
        there, means = moved(anchors, means_of(true, anchors), motion[:2, 2], xi[2])
        means = means + 0.003 * rng.normal(size=means.shape)
        common = motion_of_everything(means[:, 0], there)
        stated = 0.003**2 * np.eye(2 * len(true)) + common @ np.diag(sigmas**2) @ common.T
        framed.append(own_gauge(means, stated, there, true).frame_squared)
    low, high = chi2.ppf([0.001, 0.999], 200 * 3) / 200
    assert low < np.mean(framed) < high


def test_a_lone_wall_and_parallel_walls_have_the_shape_that_is_left():
    anchors, true, cov = walls_of(np.random.default_rng(1), count=1)
    lone = own_gauge(means_of(true, anchors), cov, anchors, true)
    assert (lone.dof, lone.anees) == (0, None)
    anchors = np.array([[0.0, 1.0], [0.0, 3.0]])
    true = np.column_stack([np.full(2, np.pi / 2), anchors[:, 1]])
    means = means_of(true, anchors) + np.array([[0.0, 0.1], [0.0, -0.1]])
    found = own_gauge(means, 0.01 * np.eye(4), anchors, true)
    assert found.dof == 2  # the distance between them, and the angle
    assert found.anees == pytest.approx(0.5 * 2 * 0.1**2 / 0.01)


def test_a_covariance_that_is_none_raises():
    anchors, true, cov = walls_of(np.random.default_rng(1))
    with pytest.raises(np.linalg.LinAlgError):
        own_gauge(means_of(true, anchors), -cov, anchors, true)
