"""A robot in random buildings: a sample of what `make random` runs in full."""

import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from studies.exploration.random_buildings import faults

SMALL = (22, 60, 65, 123, 214, 277)
"""Seeds of buildings with little floor, hence quick to explore."""
CLEAN = {"status": "complete", "reason": "", "collisions": 0, "coverage": 1.0}
CLEAN |= {"contours_closed": 1, "contours_reachable": 1}


@pytest.mark.parametrize("seed", SMALL)
def test_a_random_building_is_explored_whole_without_a_touch(seed):
    assert faults(run_trial(TrialConfig(f"random:{seed}", errorless=True, max_steps=5000)).summary) == []


def test_pillars_that_show_three_beams_from_afar_are_walls_in_the_end():
    """All the floor of `random:138` is seen from along its walls, and of its pillars only a few beams at a time."""
    summary = run_trial(TrialConfig("random:138", errorless=True, max_steps=5000)).summary
    assert summary["contours_closed"] == summary["contours_reachable"] == 7
    assert summary["coverage"] > 0.99


@pytest.mark.parametrize(
    "change",
    [
        {"status": "stopped"},
        {"status": "failed", "coverage": None},
        {"collisions": 1},
        {"coverage": 0.97},
        {"contours_closed": 0},
    ],
)
def test_whatever_is_not_clean_is_named(change):
    assert faults(CLEAN) == []
    assert len(faults(CLEAN | change)) == 1
