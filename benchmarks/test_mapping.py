"""Cost of the stages of the mapper's step, each on what it was given in a mission in paper-fig9."""

from collections.abc import Callable
from itertools import islice

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from chainslam.explore.mission import explore_mission
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.association.matching import match
from chainslam.slam.association.view import View
from chainslam.slam.backends import BACKENDS
from chainslam.slam.backends.frame.frame import Frame
from chainslam.slam.mapper import Mapper


@pytest.fixture(scope="module")
def views() -> list[View]:
    """Return what each of 200 scans of a mission was held against."""
    world, seen = load("paper-fig9"), []

    class Watched(Mapper):
        def _view(self, *scan_segments_walls, **asked) -> View:
            view = super()._view(*scan_segments_walls, **asked)
            seen.append(view)
            return view

    estimator = BACKENDS["full-ekf"].make(world.start.copy(), np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2)
    mission = explore_mission(SimulatedRobot(world, 1), Watched(estimator), STRATEGIES["nearest-robot"].make())
    assert len(list(islice(mission, 200))) == 200
    return seen


def in_turn(benchmark: BenchmarkFixture, work: Callable, given: list) -> None:
    """Measure work on each of the given arguments."""
    work(*given[0])
    waiting = iter(given)
    benchmark.pedantic(work, setup=lambda: (next(waiting), {}), rounds=len(given))


@pytest.mark.parametrize("clear_only", [True, False])
def test_matching_one_scan(benchmark: BenchmarkFixture, views: list[View], clear_only: bool) -> None:
    given = [(view.segments, view.walls, view.joint, view.config) for view in views]
    in_turn(benchmark, lambda *view: match(*view, clear_only=clear_only), given)


def test_the_joint_of_a_map_that_began_in_the_blind(benchmark: BenchmarkFixture, views: list[View]) -> None:
    frame = Frame(np.array([1.0, -2.0, 0.4]), np.diag([0.3, 0.2, 0.05]) ** 2)
    in_turn(benchmark, frame.joint_world, [(view.joint,) for view in views])
