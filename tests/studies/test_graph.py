"""The factor graph against the independent dense solution, on a recorded run of the simulator."""

import pytest

from chainslam.experiments.replays.recordings import record
from chainslam.experiments.replays.replay import ReplayOptions, replay
from chainslam.experiments.scenario import TrialConfig
from chainslam.slam.backends.graph.config import GraphConfig
from studies.consistency.graph import Problem, differences
from studies.consistency.graph_settings import told_again

MILLIMETRE, HUNDREDTH_DEGREE = 1.0, 0.01


@pytest.fixture(scope="module")
def run():
    return record(TrialConfig("paper-fig8", "full-ekf", seed=3, max_steps=40))


@pytest.mark.parametrize("perfect_extraction", [True, False])
def test_the_graph_is_the_dense_solution_of_a_real_log_without_being_asked_to_linearise_anew(run, perfect_extraction):
    off = differences(replay(run, "graph", ReplayOptions("true", perfect_extraction)).scenario.backend)
    assert off["place_mm"] < MILLIMETRE
    assert off["line_mm"] < MILLIMETRE
    assert off["heading_deg"] < HUNDREDTH_DEGREE
    assert off["sigma_share"] < 0.01
    assert off["covariance"] < 0.02


def test_told_again_the_graph_is_the_same_and_linearised_less_often_it_is_farther_off(run):
    first = replay(run, "graph", ReplayOptions("true", perfect_extraction=True)).scenario.backend
    again, _ = told_again(Problem.of(first.record), GraphConfig())
    rarely, _ = told_again(Problem.of(first.record), GraphConfig(relinearise_angle_rad=1.0, relinearise_place_m=9.0))
    off = differences(again)
    assert off["line_mm"] == pytest.approx(differences(first)["line_mm"], abs=1e-3)
    assert differences(rarely)["line_mm"] > 2 * off["line_mm"]
