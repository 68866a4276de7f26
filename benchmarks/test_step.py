"""Cost of one whole step, sense to command, over a mission; the target is 10 ms on average."""

from collections.abc import Iterator

import jaxtyping
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from explore.mission import explore_mission
from explore.step import Step
from explore.strategies import STRATEGIES
from sim.robot import SimulatedRobot
from sim.worlds import load
from slam.backends import BACKENDS
from slam.mapper import Mapper


@pytest.fixture(autouse=True)
def _unchecked() -> Iterator[None]:
    """Measure without the shape checks that pytest adds: they cost more than the step itself."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_one_step_of_a_mission(benchmark: BenchmarkFixture, backend: str) -> None:
    """Every round is one step of a noisy mission in paper-fig9 to its end, driving included."""
    world = load("paper-fig9")
    cov = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2

    def steps() -> Iterator[Step]:
        for seed in range(1, 1000):
            robot = SimulatedRobot(world, seed)
            estimator = BACKENDS[backend].make(world.start.copy(), cov.copy())
            yield from explore_mission(robot, Mapper(estimator), STRATEGIES["nearest-robot"].make())

    walk = steps()
    length = sum(1 for step in walk_once(walk))
    benchmark.pedantic(lambda: next(walk), rounds=length, warmup_rounds=0)


def walk_once(walk: Iterator[Step]) -> Iterator[Step]:
    """Yield the steps of one mission, which also warms everything up."""
    for step in walk:
        yield step
        if step.ended is not None:
            return
