"""Which walls carry a map's error: what is told of one short run, and how a table shows it."""

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.scenario import TrialConfig
from experiments.scoring.summary import map_error
from experiments.trial import run_trial
from studies.exploration.map_causes import causes, shares_of_one_wall, table


def test_the_share_of_one_wall_counts_all_its_faces():
    truth = SimpleNamespace(walls=np.array([0, 0, 1]))
    votes = SimpleNamespace(truth=truth, beams={3: np.array([4, 2, 2]), 5: np.array([0, 0, 7]), 8: np.zeros(3, int)})
    assert shares_of_one_wall(votes, np.array([3, 5, 8, 9])).tolist() == [0.75, 1.0, 1.0, 1.0]


def test_of_one_run_all_walls_are_scored_as_in_its_summary():
    result = run_trial(TrialConfig("paper-fig4", "invariant-ekf", seed=1, max_steps=40))
    found = causes(result)
    assert found["map_anees"] == pytest.approx(result.summary["map_anees"])
    assert 0 < found["lines"] >= found["short"]
    told = table([{"world": "paper-fig4"} | found])
    assert next(told.columns[0].cells) == "paper-fig4"
    assert next(told.columns[1].cells) == str(found["lines"])


def test_tentative_walls_are_scored_by_themselves_only():
    """After two scans of figure 9 one wall was seen once."""
    result = run_trial(TrialConfig("paper-fig9", "invariant-ekf", seed=1, max_steps=2))
    found, walls = causes(result), result.last.map
    assert np.count_nonzero(walls.tentative) == 1 == len(walls) - found["lines"]
    every = map_error(result.votes, walls.ids, result.joint, np.ones(len(walls), dtype=bool))
    assert found["with_tentative"] == pytest.approx(every.anees) != pytest.approx(found["map_anees"])
