"""The verdict on an estimator is that of its ANEES and their intervals, at the very limits."""

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.consistency import (
    CAUTIOUS,
    CONSISTENT,
    OVERCONFIDENT,
    TOO_FEW,
    WITHIN,
    consistency,
    in_words,
    judge,
)
from chainslam.experiments.campaign.comparison.curves import along_path
from chainslam.experiments.scoring.statistics import FEW_RUNS, estimate


def of(mean, low, high, runs=FEW_RUNS, **more):
    return {"mean": mean, "low": low, "high": high, "runs": runs, "low_buildings": None, "high_buildings": None} | more


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (of(1.0, 0.9, 1.1), CONSISTENT),
        (of(1.2, 1.05, WITHIN), CONSISTENT),
        (of(1.2, 1.05, WITHIN + 1e-9), TOO_FEW),
        (of(0.8, 1 / WITHIN, 0.9), CONSISTENT),
        (of(0.8, 1 / WITHIN - 1e-9, 0.9), TOO_FEW),
        (of(1.6, 1.01, 3.0), OVERCONFIDENT),
        (of(1.6, 1.0, 3.0), TOO_FEW),
        (of(1.45, 1.3, 1.6), TOO_FEW),
        (of(0.5, 0.3, 0.9), CAUTIOUS),
        (of(0.5, 0.3, 1.1), TOO_FEW),
        (of(9.0, 8.0, 10.0, FEW_RUNS - 1), TOO_FEW),
        (of(9.0, None, None), TOO_FEW),
        (of(9.0, None, None, low_buildings=5.0, high_buildings=13.0), OVERCONFIDENT),
    ],
)
def test_a_mean_is_judged_by_its_interval(found, verdict):
    assert judge(found) == verdict


@pytest.mark.parametrize(
    ("pose", "walls", "verdict", "factor", "what"),
    [
        (of(1.0, 0.9, 1.1), of(1.0, 0.9, 1.1), CONSISTENT, None, None),
        (of(1.0, 0.9, 1.1), of(4.0, 3.0, 5.0), OVERCONFIDENT, 4.0, "map"),
        (of(9.0, 8.0, 10.0), of(4.0, 3.0, 5.0), OVERCONFIDENT, 9.0, "pose"),
        (of(9.0, 8.0, 10.0), of(4.0, None, None), OVERCONFIDENT, 9.0, "pose"),
        (of(1.0, 0.9, 1.1), of(1.0, 0.5, 2.0), TOO_FEW, None, None),
        (of(0.5, 0.4, 0.6), of(0.25, 0.2, 0.3), CAUTIOUS, 4.0, "map"),
        (of(0.5, 0.4, 0.6), of(1.0, 0.9, 1.1), CAUTIOUS, 2.0, "pose"),
        (of(1.0, 0.9, 1.1), None, CONSISTENT, None, None),
        (None, None, TOO_FEW, None, None),
    ],
)
def test_the_worse_of_pose_and_map_decides(pose, walls, verdict, factor, what):
    found = consistency({"pose_anees_from_start": pose, "map_anees": walls})
    assert found == {"verdict": verdict, "factor": factor, "what": what}
    assert in_words(found) in (verdict, f"{verdict} to tell", f"{verdict} by a factor of {factor or 0:.2f}")


@pytest.mark.parametrize(("times", "verdict"), [(1.0, CONSISTENT), (4.0, OVERCONFIDENT), (0.3, CAUTIOUS)])
def test_runs_of_an_estimator_that_errs_by_so_much_get_that_verdict(times, verdict):
    rng = np.random.default_rng(3)
    runs = {("w", seed): times * float(rng.chisquare(60)) / 60 for seed in range(30)}
    found = estimate(runs)
    assert judge({name: getattr(found, name) for name in found.__dataclass_fields__}) == verdict


def straight(length_m, nees, steps=200):
    return np.linspace(0.0, length_m, steps), np.full(steps, float(nees))


def test_a_curve_is_the_median_of_the_runs_that_last_and_ends_where_half_of_them_do():
    along = along_path([straight(10.0, 1.0), straight(20.0, 2.0), straight(30.0, 3.0), straight(40.0, 40.0)])
    assert along.path_m[-1] == 30.0
    at = dict(zip(along.path_m.round(6).tolist(), along.median.tolist(), strict=True))
    assert (at[5.0], at[15.0], at[25.0], at[30.0]) == (2.5, 3.0, 21.5, 21.5)
    assert along.quartiles[:, 0].tolist() == [1.75, 12.25]
    assert along_path([straight(10.0, 1.0), straight(20.0, 2.0), (np.zeros(0), np.zeros(0))]).path_m[-1] == 10.0
    assert along_path([]) is along_path([straight(0.0, 1.0)]) is None


def test_the_band_holds_the_median_of_consistent_runs_in_95_percent_of_all_cases():
    rng = np.random.default_rng(0)
    path = np.linspace(0.0, 10.0, 400)
    for count in (1, 9, 10):
        along = along_path([(path, rng.chisquare(3, 400)) for _ in range(count)])
        medians = np.median(rng.chisquare(3, (4000, count)), axis=1)
        low, high = along.band[:, 5]
        assert np.mean((medians >= low) & (medians <= high)) == pytest.approx(0.95, abs=0.015)


def test_steps_without_a_covariance_are_in_no_median_and_runs_without_any_leave_it_open():
    path, nees = straight(10.0, 2.0)
    lost = np.where(path > 5.0, np.nan, 9.0)
    along = along_path([(path, nees), (path, lost)])
    assert (along.median[0], along.median[-1]) == (5.5, 2.0)
    assert np.all(np.isnan(along_path([(path, np.full(200, np.nan))]).median))
