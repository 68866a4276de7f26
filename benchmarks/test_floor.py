"""Cost of the grid of free floor: one scan taken in, and the clearances of a whole grid."""

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.robot import MotionCommand, Scan

STEPS = 300


def drive() -> list[tuple[np.ndarray, Scan]]:
    """Return the scans of a robot that turns in a hall, at their true poses."""
    robot, views = SimulatedRobot(load("hall"), 1), []
    for _ in range(STEPS):
        scan = robot.sense()
        views.append((robot.record.poses_world[-1], scan))
        robot.drive(MotionCommand(0.02, 0.15))
    return views


def test_one_scan(benchmark: BenchmarkFixture) -> None:
    views, grid = drive(), FreeSpace()
    for pose, scan in views:
        grid.integrate(pose, scan)
    rounds = iter(range(10**9))
    benchmark(lambda: grid.integrate(*views[next(rounds) % STEPS]))


def test_clearances_of_a_whole_grid(benchmark: BenchmarkFixture) -> None:
    grid = FreeSpace()
    for pose, scan in drive():
        grid.integrate(pose, scan)
    everywhere = (0, grid.shape[0], 0, grid.shape[1])

    def anew() -> None:
        grid._mark(*everywhere)
        grid.clearance()

    benchmark(anew)
    benchmark.extra_info |= {"cells": grid.evidence.size}
