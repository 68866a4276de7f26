"""Computing time of a step is that of the processor: neither waiting nor compiling counts."""

import time
from dataclasses import replace

import numpy as np

from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.trial import default_mission
from chainslam.explore import mission
from chainslam.slam.geometry import compiled


class Slow:
    """A robot whose scanner keeps one waiting."""

    def __init__(self, robot, wait_s):
        self._robot, self._wait_s = robot, wait_s

    def __getattr__(self, name):
        return getattr(self._robot, name)

    def sense(self):
        time.sleep(self._wait_s)
        return self._robot.sense()


def steps(wait_s):
    """Return the computing time of three steps, that of planning in it, and what the processor worked for them."""
    scenario = build(TrialConfig("paper-fig4", backend="full-ekf", errorless=True))
    scenario = replace(scenario, robot=Slow(scenario.robot, wait_s))
    run, began = default_mission(scenario), time.thread_time()
    taken = [next(run) for _ in range(3)]
    worked = time.thread_time() - began
    return sum(step.seconds for step in taken), sum(step.planning_seconds for step in taken), worked


def test_waiting_for_a_scan_is_no_computing():
    seconds, planning, worked = steps(1.0)
    assert 0.0 < planning < seconds <= worked < 3.0


def test_compiling_is_no_computing(monkeypatch):
    monkeypatch.setattr(mission, "compiling_s", time.thread_time)
    assert max(steps(0.0)[:2]) < 1e-3


def test_only_first_calls_compile():
    factor = 2.0  # what depends on it is not kept for the next process

    def doubled(values):
        return factor * values

    kernel = compiled.Kernel(doubled)
    before = compiled.compiling_s()
    kernel(np.ones(3))
    first = compiled.compiling_s()
    assert first > before
    kernel(np.ones(5))
    assert compiled.compiling_s() == first
    kernel(np.ones((2, 2)))
    assert compiled.compiling_s() > first
