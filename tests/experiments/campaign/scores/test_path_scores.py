"""What a campaign keeps of a path and its covariances, against plain arithmetic."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from chainslam.experiments.scoring.summary import nees_of_poses
from chainslam.slam.geometry.poses import compose, inverse, to_world
from tests.experiments.campaign.scores.thirteen_steps import (
    COVS,
    OFF,
    PATH,
    START_COV,
    TRUE,
    N,
    kept,
)


def motion(before, after):
    return compose(inverse(before), after)


def test_errors_of_the_path_are_those_of_plain_loops(made):
    found = kept(made).summary
    estimated = TRUE + OFF
    assert found["ate_m"] == pytest.approx(np.sqrt(np.mean(np.sum(OFF[:, :2] ** 2, axis=1))))

    def off(moved):
        return np.mean(np.sum((to_world(estimated[:, :2], moved) - TRUE[:, :2]) ** 2, axis=1))

    best = minimize(off, np.zeros(3), tol=1e-14)
    assert found["ate_aligned_m"] == pytest.approx(np.sqrt(best.fun), rel=1e-6)
    parts = [motion(estimated[k], estimated[k + 10]) - motion(TRUE[k], TRUE[k + 10]) for k in range(N - 10)]
    shifts = [np.hypot(*part[:2]) for part in parts]
    turns = [np.angle(np.exp(1j * part[2])) for part in parts]
    assert found["rpe_m"] == pytest.approx(np.sqrt(np.mean(np.square(shifts))))
    assert found["rpe_rad"] == pytest.approx(np.sqrt(np.mean(np.square(turns))))
    assert found["world"] == "square"


def test_the_relative_error_takes_more_than_ten_steps(made):
    def shortened(n):
        names = [name for name, value in vars(made.log).items() if isinstance(value, np.ndarray) and len(value) == N]
        log = replace(
            made.log,
            **{name: getattr(made.log, name)[:n] for name in names},
            reasons=("",) * n,
            behaviours=("look",) * n,
        )
        return kept(replace(made, log=log)).summary

    assert (shortened(10)["rpe_m"], shortened(10)["rpe_rad"]) == (None, None)
    assert shortened(11)["rpe_m"] > 0.0


def test_the_trace_is_held_against_that_of_the_start(made):
    start = np.trace(START_COV)
    factors = np.array([1.0, 1.0 - 1e-7, 0.9, 0.5, 2.0] + 8 * [1.5])
    log = replace(made.log, estimated_cov=factors[:, None, None] * START_COV)
    assert np.trace(made.scenario.start_cov) == pytest.approx(start)
    found = kept(replace(made, log=log)).summary
    assert found["trace_least"] == pytest.approx(0.5)
    assert found["trace_below"] == pytest.approx(2 / N), "less than a millionth below is rounding"


def test_the_bound_is_missed_first_and_worst_somewhere(made):
    """The robot stands, so that the bound is the start's own covariance."""
    estimated = np.repeat(TRUE[:1], N, axis=0)
    factors = np.array([1.0, 1.0 - 1e-9, 0.9, 0.4, 0.8, 2.0] + 7 * [1.5])
    log = replace(made.log, estimated_world=estimated, estimated_cov=factors[:, None, None] * START_COV)
    found = kept(replace(made, log=log)).summary
    assert found["bound_margin"] == pytest.approx(-0.6 * START_COV.max() / np.trace(START_COV))
    assert (found["bound_first_m"], found["bound_worst_m"]) == (PATH[2], PATH[3])
    log = replace(log, estimated_cov=np.maximum(factors, 1.0)[:, None, None] * START_COV)
    found = kept(replace(made, log=log)).summary
    assert found["bound_margin"] == pytest.approx(0.0, abs=1e-15)
    assert found["bound_first_m"] is found["bound_worst_m"] is None


def test_the_arrays_of_the_steps_are_what_each_step_knew(made):
    arrays = kept(made).arrays
    np.testing.assert_array_equal(arrays["path_length_m"], PATH)
    np.testing.assert_array_equal(arrays["lines"], np.arange(N))
    np.testing.assert_allclose(arrays["pose_trace"], [cov[0, 0] + cov[1, 1] + cov[2, 2] for cov in COVS])
    np.testing.assert_allclose(arrays["pose_error_m"], np.hypot(*OFF[:, :2].T))
    np.testing.assert_allclose(arrays["heading_error_rad"], np.abs(OFF[:, 2]))
    np.testing.assert_allclose(arrays["heading_sigma_rad"], np.sqrt(0.003 * (1.0 + 0.1 * np.arange(N))))
    np.testing.assert_allclose(arrays["pose_nees"], nees_of_poses(TRUE + OFF, COVS, TRUE))
    relative = nees_of_poses(TRUE + 0.5 * OFF, COVS, TRUE)
    np.testing.assert_allclose(arrays["pose_nees_from_start"], relative)
    turned = replace(made.log, estimated_world=TRUE + OFF + [0.0, 0.0, 2.0 * np.pi])
    np.testing.assert_allclose(kept(replace(made, log=turned)).arrays["heading_error_rad"], np.abs(OFF[:, 2]))
