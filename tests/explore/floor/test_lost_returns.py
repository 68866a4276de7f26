"""Runs of returns that are lost are told from the scans; a sound scanner's scans stay as they are."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from chainslam.experiments.scenario import load_world
from chainslam.explore.floor.lost_returns import RUN, SCANS, LostReturns
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.people import PeopleConfig
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.robot import MotionCommand, ScannerSpec
from tests.explore.floor.test_return_kernels import runs_of

ROOMS = load_world("rooms")
AHEAD = ScannerSpec(0.1, -0.05, 0.5 * np.pi)


def drive(faults, seed=1, steps=60, world=ROOMS, beams=360, fov_rad=2.0 * np.pi, scanner=AHEAD):
    """Drive by chance; return what is kept of the returns, and each scan before and after."""
    lidar = LidarConfig(beams=beams, fov_rad=fov_rad)
    config = RobotConfig(lidar=lidar, faults=faults, scanner=scanner)
    robot, lost, rng, scans = (
        SimulatedRobot(world, seed, config=config),
        LostReturns(scanner),
        np.random.default_rng(seed),
        [],
    )
    turn = 0.0
    for _ in range(steps):
        scan = robot.sense()
        scans.append((scan, lost.believed(scan)))
        turn = float(rng.uniform(-0.17, 0.17)) if rng.random() < 0.3 else turn
        odometry = robot.drive(MotionCommand(0.1, turn))
        if odometry.touched:
            turn = 0.17
        lost.move(odometry)
    return lost, scans


@pytest.mark.parametrize(("beams", "fov_rad"), [(180, 2.0 * np.pi), (541, 1.5 * np.pi)])
@pytest.mark.parametrize("faults", [
    FaultsConfig(), FaultsConfig(dropout=0.05), FaultsConfig(bump=0.05), FaultsConfig(moving=1.0, mixed=0.5),
    FaultsConfig(people=PeopleConfig(walking=3)),
])  # fmt: skip
def test_scans_stay_as_they_are_while_no_run_is_lost(faults, beams, fov_rad):
    """However many beams go on to the maximum range, whoever walks by, and while single returns are lost."""
    lost, scans = drive(faults, beams=beams, fov_rad=fov_rad)
    assert lost.longest == 0
    assert all(told is scan for scan, told in scans)
    assert sum(np.isposinf(scan.ranges_m).sum() for scan, _ in scans) > 100


@pytest.mark.parametrize("clump", [4, 8, 12])
def test_runs_that_are_lost_are_no_free_floor_once_it_is_known(clump):
    lost, scans = drive(FaultsConfig(dropout=0.05, clump=clump), seed=clump)
    assert clump <= lost.longest <= 3 * clump
    scan, told = scans[-1]
    changed = np.isnan(told.ranges_m) & ~np.isnan(scan.ranges_m)
    assert changed.any()
    assert np.isposinf(scan.ranges_m[changed]).all()
    np.testing.assert_array_equal(told.ranges_m[~changed], scan.ranges_m[~changed])


def test_longer_runs_are_free_floor_still():
    _, scans = drive(FaultsConfig(dropout=0.05, clump=4))
    kept = [run for _, told in scans[30:] for run in runs_of(np.isposinf(told.ranges_m), True) if len(run) >= RUN]
    assert kept
    assert min(map(len, kept)) > RUN
    assert sum(map(len, kept)) > 500


def test_so_many_scans_must_show_a_lost_run():
    world = World("box", shapely.orient_polygons(shapely.box(0, 0, 3, 3)), np.array([1.5, 1.5, 0.0]), {})
    robot, lost = SimulatedRobot(world, 1), LostReturns(ScannerSpec())
    for k in range(2 * SCANS + 4):
        scan = robot.sense()
        ranges = scan.ranges_m.copy()
        if k % 2 and k < 2 * SCANS:
            ranges[20 + 7 * k : 26 + 7 * k] = np.inf
        lost.believed(replace(scan, ranges_m=ranges))
        lost.move(robot.drive(MotionCommand(0.02, 0.1)))
        assert lost.longest == (6 if k >= 2 * SCANS else 0)
