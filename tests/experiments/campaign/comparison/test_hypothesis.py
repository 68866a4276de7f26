"""Every number of the paper's hope put to the test, against plain arithmetic on marks made by hand."""

from itertools import product

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.hypothesis import MATCHES_WITHIN, hypothesis, verdict
from chainslam.experiments.scoring import statistics
from chainslam.experiments.scoring.statistics import FEW_RUNS

CONTENDER, BASELINE = ("nearest-start", "block-ekf"), ("nearest-robot", "full-ekf")
MARKS = ("10", "20", "33", "end")
TIMES = {"10": 1.5, "20": 2.0, "33": 3.0, "end": 4.0}
"""How much worse the contender is at each mark."""


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    """Resample little: intervals are for test_statistics.py to judge."""
    monkeypatch.setattr(statistics, "DRAWS", 100)


def row(side, seed, metres, error, state="driving", mode="closed"):
    strategy, backend = side
    return {
        "world": "w", "strategy": strategy, "backend": backend, "mode": mode, "association": "own", "seed": seed,
        "status": "stopped", "metres": metres, "state": state, "wall_rmse_m": error, "wall_shape_m": 2.0 * error,
        "pose_error_m": error, "pose_anees_so_far": error, "coverage": 1.0 - error,
    }  # fmt: skip


def campaign(runs=FEW_RUNS):
    """Both sides at all marks, and beside them what must not be taken for either."""
    rows = []
    for seed, metres in product(range(runs), MARKS):
        error = 0.01 * (1 + seed)
        rows += [row(BASELINE, seed, metres, error), row(CONTENDER, seed, metres, TIMES[metres] * error)]
        for other in (("nearest-start", "full-ekf"), ("nearest-robot", "block-ekf")):
            rows.append(row(other, seed, metres, 0.9))
        rows += [row(side, seed, metres, 0.8, mode="replay") for side in (BASELINE, CONTENDER)]
    return rows


def test_what_is_held_against_what_is_told():
    found = hypothesis(campaign())
    assert {key: found[key] for key in found if key != "marks"} == {
        "contender": "nearest-start with block-ekf", "baseline": "nearest-robot with full-ekf", "matches_within": 1.1,
        "decisive_mark": "33", "verdict": "does not match",
    }  # fmt: skip
    assert list(found["marks"]) == list(MARKS)


def test_the_last_mark_that_a_run_reached_decides():
    def reached(*marks):
        return [each | {"state": "driving" if each["metres"] in marks else "finished"} for each in campaign()]

    assert hypothesis(reached("10", "20"))["decisive_mark"] == "20"
    assert hypothesis(reached("10"))["decisive_mark"] == "10"
    assert hypothesis(reached())["decisive_mark"] == "end"


@pytest.mark.parametrize("metres", MARKS)
def test_at_each_mark_the_contender_is_so_many_times_as_wrong(metres):
    at = hypothesis(campaign())["marks"][metres]
    for name in ("wall_rmse_m", "wall_shape_m", "pose_anees_so_far"):
        assert (at[name]["kind"], at[name]["runs"]) == ("ratio", FEW_RUNS)
        assert at[name]["value"] == pytest.approx(TIMES[metres])
    # The pose's error is lifted by a tenth of a millimetre, so that a perfect one has a ratio.
    errors = 0.01 * np.arange(1, FEW_RUNS + 1)
    lifted = np.mean(np.log((TIMES[metres] * errors + 1e-4) / (errors + 1e-4)))
    assert at["pose_error_m"]["value"] == pytest.approx(np.exp(lifted))
    assert at["uncovered"]["kind"] == "difference"
    assert at["uncovered"]["value"] == pytest.approx(np.mean((TIMES[metres] - 1.0) * errors))


def test_runs_that_failed_before_a_mark_are_counted_and_not_compared():
    rows = campaign()
    for one in rows:
        if one["metres"] != "33":
            continue
        side = (one["strategy"], one["backend"])
        if side == CONTENDER and one["seed"] < 3:
            one["state"] = "failed"
        if side == BASELINE and one["seed"] in (3, 4):
            one["state"] = "finished"
    at = hypothesis(rows)["marks"]["33"]
    assert at["contender"] == {"driving": FEW_RUNS - 3, "finished": 0, "failed": 3}
    assert at["baseline"] == {"driving": FEW_RUNS - 2, "finished": 2, "failed": 0}
    assert at["wall_rmse_m"]["runs"] == FEW_RUNS - 3
    assert hypothesis(rows)["marks"]["20"]["wall_rmse_m"]["runs"] == FEW_RUNS
    assert hypothesis(rows)["verdict"] == "undecided", "fewer runs than it takes"


def test_a_run_without_coverage_is_in_no_mean_of_it():
    rows = campaign()
    for one in rows:
        if one["seed"] == 0:
            one["coverage"] = None
    assert hypothesis(rows)["marks"]["10"]["uncovered"]["runs"] == FEW_RUNS - 1


@pytest.mark.parametrize(("runs", "said"), [(FEW_RUNS - 1, "undecided"), (FEW_RUNS, "does not match")])
def test_a_verdict_takes_ten_runs(runs, said):
    assert hypothesis(campaign(runs))["verdict"] == said


@pytest.mark.parametrize("side", [BASELINE, CONTENDER])
def test_without_one_side_there_is_no_verdict(side):
    rows = [one for one in campaign() if (one["strategy"], one["backend"], one["mode"]) != (*side, "closed")]
    assert hypothesis(rows) is None


@pytest.mark.parametrize(
    ("intervals", "said"),
    [
        ([(0.8, MATCHES_WITHIN)], "matches"),
        ([(0.8, MATCHES_WITHIN + 1e-9)], "undecided"),
        ([(MATCHES_WITHIN, 2.0)], "undecided"),
        ([(MATCHES_WITHIN + 1e-9, 2.0)], "does not match"),
        ([(0.8, 1.0), (0.8, 2.0)], "undecided"),
        ([(0.8, 1.0), (None, 1.0)], "undecided"),
        ([(0.8, 1.0), (0.8, None)], "undecided"),
        ([(2.0, None), (0.8, 1.0)], "undecided"),
        ([(None, 1.0), (2.0, 3.0)], "does not match"),
    ],
)
def test_a_verdict_is_told_by_the_ends_of_its_intervals(intervals, said):
    assert verdict(intervals) == said
