"""A run made by hand in a square room, and the truth of that room."""

import pytest

from chainslam.experiments.scoring.truth import truth_of
from chainslam.sim.robot import RobotConfig
from tests.experiments.by_hand import true_map


@pytest.fixture
def truth(world):
    return truth_of(world, RobotConfig())


@pytest.fixture
def run(world, make_map, make_chains):
    return true_map(world, make_map, make_chains)
