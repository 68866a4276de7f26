"""NIS over windows: against sums by hand and scipy's quantiles; what the robot noticed is told in the summary."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from chainslam.experiments.scoring.innovations import WINDOW, innovation_scores, nis_in_band, windowed_nis

STEPS = 60
pytestmark = pytest.mark.usefixtures("_unchecked")


def log_with(seed=0, **changes):
    rng = np.random.default_rng(seed)
    dof = 2 * rng.integers(0, 8, STEPS)
    dof[:3] = 0
    nis = np.array([rng.chisquare(n) if n else 0.0 for n in dof])
    none = np.zeros(STEPS, bool)
    kept = {"nis": nis, "nis_dof": dof, "unstated_motion": none, "is_lost": none, "wheel_noise_factor": np.ones(STEPS)}
    return SimpleNamespace(**(kept | changes))


def test_a_window_is_the_sum_of_the_last_scans():
    log = log_with()
    for k in range(STEPS):
        first = max(0, k - WINDOW + 1)
        squared, dof = log.nis[first : k + 1].sum(), log.nis_dof[first : k + 1].sum()
        if not dof:
            assert windowed_nis(log)[k] == 0.0
            assert not nis_in_band(log)[k]
            continue
        assert windowed_nis(log)[k] == pytest.approx(squared / dof)
        assert nis_in_band(log)[k] == (chi2.ppf(0.025, dof) <= squared <= chi2.ppf(0.975, dof))


def test_most_windows_of_an_honest_filter_are_in_the_band_and_none_of_one_far_too_sure():
    shares = [innovation_scores(log_with(seed))["nis_in_band"] for seed in range(30)]
    assert np.mean(shares) == pytest.approx(0.95, abs=0.03)
    log = log_with(nis=5.0 * log_with().nis)
    assert innovation_scores(log)["nis_in_band"] < 0.05
    assert innovation_scores(log)["nis"] == pytest.approx(5.0 * innovation_scores(log_with())["nis"])


def test_what_the_robot_noticed_is_counted():
    marks = np.arange(STEPS) % 7 == 3
    log = log_with(unstated_motion=marks, is_lost=np.arange(STEPS) > 55, wheel_noise_factor=np.linspace(1, 3, STEPS))
    scores = innovation_scores(log)
    assert scores["unstated_motions"] == marks.sum()
    assert scores["lost_steps"] == 4
    assert scores["wheel_noise_factor"] == 3.0


def test_a_robot_that_matched_nothing_has_no_nis():
    log = log_with(nis=np.zeros(STEPS), nis_dof=np.zeros(STEPS, int))
    assert innovation_scores(log)["nis"] is None
    assert innovation_scores(log)["nis_in_band"] is None
