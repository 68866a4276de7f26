"""The error of a pose is what its definition says, by matrix logarithms, and its covariance goes with it."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.linalg import expm, logm

from chainslam.experiments.library.audit.geometry.kinds import since_start
from chainslam.experiments.library.audit.geometry.plane import errors, motion_at_start, moved_covs, to_frame
from chainslam.experiments.scoring.trajectories import alignment_of_paths, moved
from chainslam.slam.evaluation.consistency import nees

FRAMES = ("additive", "body", "world")
PLACES = st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-3.1, 3.1)).map(np.array)
SMALL = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-1.0, 1.0)).map(np.array)


def matrix(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def pose_of(X):
    return np.array([X[0, 2], X[1, 2], np.arctan2(X[1, 0], X[0, 0])])


def hat(xi):
    return np.array([[0.0, -xi[2], xi[0]], [xi[2], 0.0, xi[1]], [0.0, 0.0, 0.0]])


def vee(X):
    return np.array([X[0, 2], X[1, 2], X[1, 0]])


@given(PLACES, SMALL)
@example(np.array([2.1551928538437914e-106, 0.0, 0.0]), np.array([0.0, 0.0, 2.1551928538437914e-106]))
@np.errstate(all="ignore")  # SciPy divides by angles of 1e-106
def test_errors_are_the_logarithms_that_they_are_called(pose, off):
    estimated, true = matrix(pose), matrix(pose) @ matrix(off)
    both = pose[None], pose_of(true)[None]
    assert errors(*both, "body")[0] == pytest.approx(vee(np.real(logm(np.linalg.inv(estimated) @ true))), abs=1e-9)
    assert errors(*both, "world")[0] == pytest.approx(vee(np.real(logm(true @ np.linalg.inv(estimated)))), abs=1e-7)
    plain = errors(*both, "additive")[0]
    assert plain[:2] == pytest.approx(both[1][0, :2] - pose[:2], abs=1e-12)
    assert np.exp(1j * plain[2]) == pytest.approx(np.exp(1j * off[2]), abs=1e-9)


def _disturbed(pose, xi, frame):
    if frame == "additive":
        return pose + xi
    return pose_of(matrix(pose) @ expm(hat(xi)) if frame == "body" else expm(hat(xi)) @ matrix(pose))


@pytest.mark.parametrize("given_in", FRAMES)
@pytest.mark.parametrize("wanted", FRAMES)
def test_covariances_of_one_frame_become_those_of_another_as_finite_differences_do(given_in, wanted):
    rng = np.random.default_rng(1)
    poses = rng.uniform(-3.0, 3.0, (5, 3))
    roots = rng.standard_normal((5, 3, 3))
    covs = roots @ roots.swapaxes(1, 2)
    h, found = 1e-6, to_frame(poses, covs, given_in, wanted)
    for pose, cov, told in zip(poses, covs, found, strict=True):
        columns = [
            (errors(pose[None], _disturbed(pose, h * axis, given_in)[None], wanted)
             - errors(pose[None], _disturbed(pose, -h * axis, given_in)[None], wanted))[0] / (2 * h)
            for axis in np.eye(3)
        ]  # fmt: skip
        change = np.stack(columns, axis=1)
        assert told == pytest.approx(change @ cov @ change.T, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("frame", FRAMES)
def test_the_nees_does_not_depend_on_the_frame_of_the_world(frame):
    rng = np.random.default_rng(2)
    true = rng.uniform(-3.0, 3.0, (20, 3))
    estimated = true + 0.1 * rng.standard_normal((20, 3))
    roots = rng.standard_normal((20, 3, 3))
    covs, motion = roots @ roots.swapaxes(1, 2) + np.eye(3), np.array([4.0, -2.0, 0.7])
    before = nees(errors(estimated, true, frame), covs)
    turned = moved(estimated, motion), moved(true, motion)
    assert nees(errors(*turned, frame), moved_covs(covs, motion, frame)) == pytest.approx(before, rel=1e-9)


def test_paths_are_brought_onto_each_other():
    rng = np.random.default_rng(3)
    true = rng.uniform(-3.0, 3.0, (20, 3))
    estimated = moved(true, np.array([1.0, 2.0, 0.5]))
    for motion in (motion_at_start(estimated, true), alignment_of_paths(estimated, true)):
        assert moved(estimated, motion) == pytest.approx(true, abs=1e-9)


@pytest.mark.parametrize("frame", FRAMES)
def test_what_was_lost_since_the_start_is_scored_without_the_error_of_the_start(frame):
    """Dead reckoning: the error since the start does not know how large that of the start is."""
    rng = np.random.default_rng(4)
    wheels = np.diag([0.02**2, 0.01**2, 0.01**2])
    scores = []
    for spread in (1e-3, 0.3):
        start = np.diag([spread, spread, spread]) ** 2
        values = []
        for _ in range(150):
            true, mean = np.array([1.0, 2.0, 0.3]), np.array([1.0, 2.0, 0.3]) + spread * rng.standard_normal(3)
            P, kept = start, [(true, mean, start)]
            for _ in range(5):
                motion, noise = np.array([0.2, 0.0, 0.1]), 0.01 * rng.standard_normal(3) * [2.0, 1.0, 1.0]
                body = to_frame(mean[None], P[None], "additive", "body")
                true = pose_of(matrix(true) @ matrix(motion) @ expm(hat(noise)))
                mean, back = pose_of(matrix(mean) @ matrix(motion)), np.linalg.inv(matrix(motion))
                Ad = np.block([[back[:2, :2], np.array([[back[1, 2]], [-back[0, 2]]])], [np.zeros((1, 2)), np.eye(1)]])
                P = to_frame(mean[None], Ad @ body @ Ad.T + wheels, "body", "additive")[0]
                kept.append((true, mean, P))
            trues, means, Ps = (np.array(column) for column in zip(*kept, strict=True))
            left, covs = since_start(means, trues, to_frame(means, Ps, "additive", frame), frame)
            values.append(nees(left, covs)[-1])
        scores.append(np.mean(values) / 3.0)
    assert scores == pytest.approx([1.0, 1.0], abs=0.2)
