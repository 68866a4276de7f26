"""The factor graph against the independent dense solution, on a recorded run of the simulator."""

import pytest

from experiments.replays.recordings import record
from experiments.replays.replay import ReplayOptions, replay
from experiments.scenario import TrialConfig
from studies.consistency.graph import differences

MILLIMETRE, HUNDREDTH_DEGREE = 1.0, 0.01


@pytest.fixture(scope="module")
def run():
    return record(TrialConfig("paper-fig8", "full-ekf", seed=9, max_steps=40))


@pytest.mark.parametrize("perfect_extraction", [True, False])
def test_the_graph_is_the_dense_solution_of_a_real_log_without_being_asked_to_linearise_anew(run, perfect_extraction):
    off = differences(replay(run, "graph", ReplayOptions("true", perfect_extraction)).scenario.backend)
    assert off["place_mm"] < MILLIMETRE
    assert off["line_mm"] < MILLIMETRE
    assert off["heading_deg"] < HUNDREDTH_DEGREE
    assert off["sigma_share"] < 0.01
    assert off["covariance"] < 0.02
