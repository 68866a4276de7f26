"""Whole runs among people: the robot touches nobody, and never says `complete` of what it has not seen."""

import pytest

from chainslam.experiments.artifacts.settings import nested, trial_of
from chainslam.experiments.trial import run_trial

PEOPLE = "robot.faults.people"


@pytest.mark.long
@pytest.mark.parametrize(("walking", "seed"), [(1, 1), (3, 1), (3, 2), (3, 3)])
def test_among_people_a_run_covers_the_building_or_says_that_ends_are_left(walking, seed):
    settings = nested([(f"{PEOPLE}.walking", walking)])
    summary = run_trial(trial_of(settings, {"world": "rooms", "seed": seed, "max_steps": 3000})).summary
    assert summary["collisions"] == 0
    if summary["status"] == "complete":
        assert summary["coverage"] >= 0.97
    else:
        assert summary["outcome"] == "ends-left"
