"""The NEES of every step, worked out again from the files alone, by the formulas of docs/concepts/scores.md."""

import csv

import jaxtyping
import numpy as np
import pytest
from scipy.linalg import logm

from chainslam.experiments.commands.cli import main

ENTRIES = ("xx", "xy", "xt", "yy", "yt", "tt")
STEPS = 20


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A noisy run from a poor start, and two replays of it; without the shape checks, which would take longer."""
    out = tmp_path_factory.mktemp("nees") / "run"
    explore = ["explore", "paper-fig8", "--seed", "6", "--p0", "large", "--max-steps", str(STEPS), "--out", str(out)]
    jaxtyping.config.update("jaxtyping_disable", True)
    try:
        assert main(explore) == 0
        assert main(["replay", str(out / "log.npz"), "--backend", "block-ekf", "graph"]) == 0
    finally:
        jaxtyping.config.update("jaxtyping_disable", False)
    return out


def columns(folder):
    with (folder / "steps.csv").open() as file:
        rows = list(csv.DictReader(file))
    return {
        name: np.array([float(row[name]) for row in rows]) for name in rows[0] if name not in ("behaviour", "reason")
    }


def matrix(pose):
    """Return a pose as a matrix of SE(2)."""
    x, y, heading = pose
    return np.array([[np.cos(heading), -np.sin(heading), x], [np.sin(heading), np.cos(heading), y], [0.0, 0.0, 1.0]])


def invariant_error(estimated, true):
    """Return xi of X_est = Exp(xi) X_true, by the logarithm of a matrix."""
    twist = np.real(logm(matrix(estimated) @ np.linalg.inv(matrix(true))))
    return np.array([twist[0, 2], twist[1, 2], twist[1, 0]])


def poses_of(table, prefix):
    return np.column_stack([table[f"{prefix}{name}"] for name in ("x_m", "y_m", "heading_rad")])


def covariances(table):
    cov = np.empty((len(table["step"]), 3, 3))
    for name in ENTRIES:
        i, j = ("xyt".index(letter) for letter in name)
        cov[:, i, j] = cov[:, j, i] = table[f"cov_{name}"]
    return cov


@pytest.mark.parametrize("name", ["", "replay-own/block-ekf", "replay-own/graph"])
def test_the_nees_of_every_step_comes_out_of_its_row(folder, name):
    table = columns(folder / name)
    estimated, true, cov = poses_of(table, ""), poses_of(table, "true_"), covariances(table)
    assert len(cov) == STEPS
    found, plain = [], []
    for pose, truth, P in zip(estimated, true, cov, strict=True):
        T = np.array([[1.0, 0.0, pose[1]], [0.0, 1.0, -pose[0]], [0.0, 0.0, 1.0]])
        xi = invariant_error(pose, truth)
        found.append(xi @ np.linalg.solve(T @ P @ T.T, xi))
        plain.append((pose - truth) @ np.linalg.solve(P, pose - truth))
    np.testing.assert_allclose(found, table["pose_nees"], rtol=1e-9)
    assert np.abs(np.array(plain) / table["pose_nees"] - 1.0).max() > 1e-3, "the frame of the covariance matters"
    np.testing.assert_array_equal(cov.trace(axis1=1, axis2=2), table["pose_trace"])
    for trajectory, poses in (("estimated", estimated), ("true", true)):
        tum = np.loadtxt(folder / name / f"trajectory_{trajectory}.tum")
        np.testing.assert_allclose(tum[:, 0], table["time_s"], atol=1e-6)
        np.testing.assert_allclose(tum[:, 1:3], poses[:, :2], atol=1e-9)
        np.testing.assert_allclose(np.exp(2j * np.arctan2(tum[:, 6], tum[:, 7])), np.exp(1j * poses[:, 2]), atol=1e-9)
