"""Differences between runs, families of them, and the verdicts that they make."""

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.comparison import Measure, cell_scores, difference
from chainslam.experiments.campaign.comparison.hypothesis import hypothesis, verdict
from chainslam.experiments.scoring.statistics import estimate, holm, paired, share_better


def runs(rng, seeds=20, spread=0.0):
    offsets = spread * rng.normal(size=2)
    return {(f"b{b}", s): offsets[b] + rng.normal() for b in range(2) for s in range(seeds)}


def test_holm_steps_down_from_the_smallest():
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_allclose(holm([0.9, 0.6]), [1.0, 1.0])
    assert not len(holm([]))


def test_pairing_takes_away_what_two_sides_share():
    rng = np.random.default_rng(5)
    common = runs(rng, seeds=40, spread=5.0)
    other = {run: value + 0.1 + 0.1 * rng.normal() for run, value in common.items()}
    found = estimate(paired(other, common))
    assert found.low < 0.1 < found.high
    assert found.high - found.low < 0.1
    assert found.effect_size == pytest.approx(1.0, abs=0.4)


def test_a_missing_value_is_a_failure_and_loses():
    first, second = {("a", 1): 1.0, ("a", 2): 5.0}, {("a", 1): 2.0, ("a", 3): 0.0}
    everyone = {("a", seed) for seed in (1, 2, 3, 4)}
    assert share_better(first, second, everyone) == pytest.approx((1 + 1 + 0 + 0.5) / 4)
    assert share_better(first, second, set()) is None


def row(seed, value, status="complete", **more):
    return {"world": "w", "seed": seed, "status": status, "x": value, **more}


def test_a_difference_counts_the_runs_that_it_cannot_compare():
    first = [row(1, 2.0), row(2, 2.0), row(3, 2.0, "failed")]
    second = [row(1, 1.0), row(2, 1.0), row(3, 1.0)]
    found = difference(first, second, Measure("x", True))
    assert found["value"] == pytest.approx(2.0)
    assert (found["runs"], found["pairs_without_value"], found["first_better"]) == (2, 1, 0.0)


def mark(strategy, backend, seed, metres, wall, state="driving"):
    return {
        "world": "w", "strategy": strategy, "backend": backend, "mode": "closed", "association": "own", "seed": seed,
        "status": "complete", "metres": metres, "state": state, "wall_rmse_m": wall, "wall_shape_m": wall,
        "pose_error_m": wall, "pose_anees_so_far": 1.0, "coverage": 0.9,
    }  # fmt: skip


@pytest.mark.parametrize(("times", "expected"), [(2.0, "does not match"), (1.0, "matches")])
def test_the_hypothesis_is_decided_by_the_interval_of_the_ratio(times, expected):
    rng = np.random.default_rng(0)
    rows = []
    for seed in range(30):
        error = 0.01 * np.exp(0.3 * rng.normal())
        noise = np.exp(0.05 * rng.normal())
        for metres in ("10", "20", "33", "end"):
            rows.append(mark("nearest-robot", "full-ekf", seed, metres, error))
            rows.append(mark("nearest-start", "block-ekf", seed, metres, times * error * noise))
    found = hypothesis(rows)
    assert found["verdict"] == expected
    assert found["marks"]["33"]["wall_rmse_m"]["value"] == pytest.approx(times, rel=0.05)
    assert found["marks"]["33"]["contender"] == {"driving": 30, "finished": 0, "failed": 0}


def test_a_handful_of_runs_decides_nothing():
    sides = (("nearest-robot", "full-ekf", 0.1), ("nearest-start", "block-ekf", 0.3))
    rows = [mark(*side, seed, "33", wall) for *side, wall in sides for seed in range(5)]
    assert hypothesis(rows)["verdict"] == "undecided"


def test_without_both_sides_there_is_no_verdict():
    assert hypothesis([mark("nearest-robot", "full-ekf", 1, "33", 0.1)]) is None
    assert verdict([(None, None)]) == verdict([(0.9, 1.3)]) == "undecided"


def test_a_match_is_one_of_place_and_of_shape():
    good, bad, open_ = (0.8, 1.0), (1.5, 2.0), (0.9, 1.3)
    assert verdict([good, good]) == "matches"
    assert verdict([good, bad]) == verdict([bad, open_]) == "does not match"
    assert verdict([good, open_]) == verdict([good, (None, None)]) == "undecided"


def test_a_run_that_ended_at_a_limit_keeps_its_scores_and_one_that_failed_has_none():
    same = {"world": "w", "seed": 1, "bound_margin": -0.1, "bound_first_m": 1.0, "bound_worst_m": 2.0}
    done = same | {"status": "complete", "pose_anees": 1.0, "double_entries": 1, "sightings": 100}
    lost = same | {"seed": 2, "status": "stopped", "pose_anees": 900.0, "double_entries": 19, "sightings": 400,
                   "bound_margin": -3.0, "missed_share": 0.2}  # fmt: skip
    scores = cell_scores([done, lost, same | {"seed": 3, "status": "failed", "double_entries": 50}])
    assert (scores["trials"], scores["complete"], scores["sound"]) == (3, 1, 2)
    assert scores["pose_anees"]["mean"] == 450.5
    assert (scores["double_entries"], scores["sightings"]) == (20, 500)
    assert (scores["bound_margin"], scores["bound_runs_below"]) == (-3.0, 2)
    assert scores["missed_share"]["mean"] == 0.2
