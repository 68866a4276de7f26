"""Every column of a run's steps.csv, from three steps made by hand, against plain arithmetic."""

import csv

import numpy as np
import pytest

from chainslam.experiments.artifacts.results import steps_csv
from chainslam.experiments.scoring.keys import Steps
from chainslam.experiments.scoring.summary import nees_of_poses
from tests.experiments.by_hand import COVS, OFF, TRUE, log_of


def test_each_column_is_that_of_its_name():
    log = log_of(
        reasons=("begins", "follows", "ends"),
        behaviours=("look", "follow", "look"),
        route_walls=np.array([0, 3, 0]),
        set_aside=np.array([0, 1, 2]),
        touched=np.array([True, False, True]),
        nis=np.array([0.0, 3.0, 9.0]),
        nis_dof=np.array([0, 4, 4]),
        unstated_motion=np.array([False, True, False]),
        is_lost=np.array([False, False, True]),
        wheel_noise_factor=np.array([1.0, 1.0, 3.0]),
    )
    rows = list(csv.DictReader(steps_csv(log).decode().splitlines()))
    table = {name: [row[name] for row in rows] for name in Steps.__annotations__}
    assert table.pop("reason") == ["begins", "follows", "ends"]
    assert table.pop("behaviour") == ["look", "follow", "look"]
    estimated = TRUE + OFF
    # The odometry alone go to (1.1, 1) and (1.2, 1) from the true start.
    expected = {
        "step": [0, 1, 2], "time_s": [0, 1, 2], "path_length_m": [0.0, 0.1, 0.25],
        "pose_nees": nees_of_poses(estimated, COVS, TRUE),
        "pose_nees_from_start": nees_of_poses(estimated, COVS, TRUE),
        "pose_trace": COVS[:, 0, 0] + COVS[:, 1, 1] + COVS[:, 2, 2],
        "open_ends": [1, 2, 4], "lines": [3, 3, 3], "lines_tentative": [0, 0, 1], "closed_chains": [0, 0, 1],
        "set_aside": [0, 1, 2], "x_m": estimated[:, 0], "y_m": estimated[:, 1], "heading_rad": estimated[:, 2],
        "true_x_m": TRUE[:, 0], "true_y_m": TRUE[:, 1], "true_heading_rad": TRUE[:, 2], "error_heading_rad": OFF[:, 2],
        "sigma_x_m": np.sqrt(COVS[:, 0, 0]), "sigma_y_m": np.sqrt(COVS[:, 1, 1]),
        "sigma_heading_rad": np.sqrt(COVS[:, 2, 2]),
        "cov_xx": COVS[:, 0, 0], "cov_xy": COVS[:, 0, 1], "cov_xt": COVS[:, 0, 2], "cov_yy": COVS[:, 1, 1],
        "cov_yt": COVS[:, 1, 2], "cov_tt": COVS[:, 2, 2], "odometry_error_m": [0.0, 0.5, 0.3], "collisions": [1, 1, 2],
        "step_ms": [6.0, 1.0, 2.0], "nis": [0.0, 3.0, 9.0], "nis_dof": [0, 4, 4], "nis_in_band": [0, 1, 1],
        "nis_window": [0.0, 0.75, 1.5],
        "unstated_motion": [0, 1, 0], "lost": [0, 0, 1], "wheel_noise_factor": [1.0, 1.0, 3.0],
        "route_walls": [0, 3, 0],
    }  # fmt: skip
    for name, values in expected.items():
        assert [float(value) for value in table.pop(name)] == pytest.approx(list(values), abs=1e-6), name
    # What is left is the shift of the world that X_est = Exp(xi) X_true asks for.
    assert table.keys() == {"error_x_m", "error_y_m"}
    for k, (x, y, turn) in enumerate(zip(table["error_x_m"], table["error_y_m"], OFF[:, 2], strict=True)):
        c, s = np.cos(turn), np.sin(turn)
        V = np.array([[s, c - 1.0], [1.0 - c, s]]) / turn
        moved = np.array([[c, -s], [s, c]]) @ TRUE[k, :2] + V @ [float(x), float(y)]
        np.testing.assert_allclose(moved, estimated[k, :2], atol=1e-6)
