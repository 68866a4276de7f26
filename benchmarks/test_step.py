"""Cost of one whole step, sense to command, over a mission; the target is 10 ms on average."""

import os
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from chainslam.explore.mission import explore_mission
from chainslam.explore.step import Step
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper

PLAN = Path(os.environ.get("PLAN", Path(__file__).parents[1] / "tests" / "data" / "plans" / "school.json"))
"""A school of 333 m2 with 77 faces, or the file that the environment names."""
STEPS, WARM, BIN = 3000, 200, 100
"""Of a long mission: all, those at the beginning that load and compile, and those of which one median is taken."""


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


@pytest.mark.parametrize("backend", ["full-ekf", "invariant-ekf"])
def test_a_step_takes_as_long_in_a_large_map_and_after_a_long_way(benchmark: BenchmarkFixture, backend: str) -> None:
    """Exponents b of time = a lines^b and of time = a path^b, of medians of 100 steps: flat is 0, the target 0.1.

    Processor time, sense to command, over that of a fixed piece of work in turn: a busy machine slows both down.
    `extra_info` and the output hold the exponents and their standard errors.
    """
    world, cov = load(str(PLAN)), np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2
    estimator, strategy = BACKENDS[backend].make(world.start.copy(), cov), STRATEGIES["nearest-robot"].make()
    steps = islice(explore_mission(SimulatedRobot(world, 1), Mapper(estimator), strategy), STEPS)
    rows = []

    def drive() -> None:
        began = time.thread_time()
        for step in steps:
            took = time.thread_time() - began
            rows.append((took, fixed_work_s(), len(step.map), step.path_length_m))
            began = time.thread_time()

    benchmark.pedantic(drive, rounds=1, iterations=1)
    step_s, work_s, lines, path_m = np.array(rows[WARM : WARM + (len(rows) - WARM) // BIN * BIN]).T.reshape(4, -1, BIN)
    ratio = np.median(step_s, axis=1) / np.median(work_s, axis=1)
    benchmark.extra_info["longest_ms"] = round(1e3 * float(step_s.max()), 1)
    print(f"longest step: {benchmark.extra_info['longest_ms']} ms")
    for name, size in (("lines", lines.mean(axis=1)), ("path", path_m.mean(axis=1))):
        fit, cov_fit = np.polyfit(np.log(size), np.log(ratio), 1, cov=True)
        benchmark.extra_info[name] = [round(float(b), 3) for b in (fit[0], np.sqrt(cov_fit[0, 0]))]
        print(f"{backend}, {len(rows)} steps, {size[0]:.0f} to {size[-1]:.0f} {name}: {benchmark.extra_info[name]}")


def fixed_work_s() -> float:
    """Return the processor time of the same small arrays and objects each time, s: what a step is made of."""
    began = time.thread_time()
    for _ in range(20):
        ends = np.linspace(0.0, 1.0, 80).reshape(20, 2, 2)
        found = np.flatnonzero(np.hypot(*(ends[:, 1] - ends[:, 0]).T) < np.sqrt(ends[:, 0].sum(axis=1)))
        np.concatenate([ends[found], np.stack([ends[:, 1], ends[:, 0]], axis=1)])
        sorted({(row, row + 1) for row in found.tolist()})
    return time.thread_time() - began
