"""Missions in the two real buildings that come with the tests."""

from dataclasses import replace
from pathlib import Path

import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial

PLANS = Path(__file__).parents[2] / "data" / "plans"


@pytest.mark.parametrize("name", ["apartment", "school"])
def test_the_first_metres_in_a_real_building_go_well(name):
    summary = run_trial(TrialConfig(str(PLANS / f"{name}.json"), max_steps=40)).summary
    assert (summary["status"], summary["steps"], summary["collisions"]) == ("stopped", 40, 0)
    assert summary["path_length_m"] > 0.8
    assert summary["pose_rmse_m"] < 0.05
    assert summary["lines"] >= 3
    assert summary["false_matches"] == 0


@pytest.mark.long
@pytest.mark.parametrize(("name", "contours"), [("apartment", 2), ("school", 3)])
def test_a_real_building_is_explored_to_its_end(name, contours):
    config = TrialConfig(str(PLANS / f"{name}.json"), "invariant-ekf", errorless=True)
    result = run_trial(config)
    summary = result.summary
    assert summary["status"] == "complete"
    assert summary["contours_closed"] == summary["contours_reachable"] == contours
    assert summary["coverage"] > 0.97
    assert summary["swept"] > 0.99
    assert summary["collisions"] == summary["false_merges"] == summary["duplicate_lines"] == 0
    # Where the robot looks around it may see six beams of a wall that turns by two degrees, of its other side. A wall
    # that is stated to be off its line stands for both.
    crooked = set(result.last.map.ids[result.last.map.crooked].tolist())
    votes = result.votes
    plane = replace(
        votes,
        fused=[each for each in votes.fused if each[0] not in crooked],
        fused_of_few_beams=[each for each in votes.fused_of_few_beams if each[0] not in crooked],
    )
    assert plane.false_matches() <= len(votes.fused) / 400
    assert votes.false_matches() <= len(votes.fused) / 100
