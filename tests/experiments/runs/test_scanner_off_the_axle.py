"""A scanner that sits off the axle: poses are the body's, walls stand where they stand, and scores see what it sees."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.replays.recordings import recorded
from chainslam.experiments.replays.replay import ReplayOptions, replay
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.maps.swept import visible_floor
from chainslam.experiments.trial import run_trial
from chainslam.explore.floor.accumulated_returns import returns
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.geometry.poses import compose, to_world, wrap
from chainslam.slam.robot import MotionCommand, ScannerSpec

OFF = RobotConfig(scanner=ScannerSpec(0.12, -0.06, 0.7))


@pytest.fixture(scope="module")
def made():
    return run_trial(TrialConfig("paper-fig4", errorless=True, p0="zero", max_steps=60, robot=OFF))


def test_estimates_and_files_are_of_the_body(made):
    log = made.log
    off = log.estimated_world - log.true_world
    assert np.abs(off[:, :2]).max() < 0.01
    assert np.abs(wrap(off[:, 2])).max() < 0.01
    assert log.path_length_m[-1] > 2.0
    ends = made.last.map.ends_world[~made.last.map.tentative].reshape(-1, 2)
    assert len(ends) >= 8
    assert distance_to_segments(ends, made.scenario.world.faces).min(axis=1).max() < 0.02
    assert made.summary["collisions"] == 0


def test_what_the_scan_hit_stands_where_the_walls_are_and_the_body_is_free(made):
    step = made.last
    assert step.robot == OFF.spec
    hits = to_world(returns(step.scan, step.robot.scanner), made.log.true_world[-1])
    assert distance_to_segments(hits, made.scenario.world.faces).min(axis=1).max() < 1e-6
    floor = step.free_space
    rim = 0.15 * np.stack([np.cos(np.arange(12)), np.sin(np.arange(12))], axis=-1)
    cells = floor.cells(step.pose_world[:2] + rim)
    assert np.all(floor.evidence[tuple(cells.T)] < 0)


@pytest.mark.parametrize("backend", ["full-ekf", "graph-batch"])
@pytest.mark.parametrize("association", ["own", "true"])
def test_replays_are_of_the_body_too(made, backend, association):
    run = recorded(made)
    again = replay(run, backend, ReplayOptions(association, perfect_extraction=association == "true"))
    assert again.ending.exit_status == 0
    assert np.abs((again.log.estimated_world - made.log.true_world)[:, :2]).max() < 0.05
    if backend == "graph-batch":
        assert np.abs((again.smoothed.poses_world - made.log.true_world)[:, :2]).max() < 0.05
        np.testing.assert_allclose(again.smoothed.joint.mean[:3], again.smoothed.map.belief.pose_world, atol=1e-9)


def test_a_scanner_that_sits_elsewhere_than_stated_is_the_simulations_secret():
    world, told = load("paper-fig4"), RobotConfig(scanner=ScannerSpec(0.12))
    secret = replace(told, faults=FaultsConfig(scanner_ahead_m=-0.12, scanner_left_m=0.1, scanner_turned_rad=0.3))
    assert secret.spec == told.spec
    assert secret.true_scanner == ScannerSpec(0.0, 0.1, 0.3)
    robots = [SimulatedRobot(world, 1, errorless=True, config=config) for config in (told, secret)]
    scans = [robot.sense() for robot in robots]
    assert not np.array_equal(scans[0].ranges_m, scans[1].ranges_m)
    for robot, config, scan in zip(robots, (told, secret), scans, strict=True):
        pose = compose(robot.true_pose, config.true_scanner.pose_robot)
        hits = to_world(returns(scan, ScannerSpec()), pose)
        assert distance_to_segments(hits, world.faces).min(axis=1).max() < 1e-6
    odometry = [robot.drive(MotionCommand(0.1, 0.1)) for robot in robots]
    np.testing.assert_array_equal(odometry[0].motion, odometry[1].motion)


def test_a_scanner_ahead_may_see_more_and_never_less():
    world = load("rooms")
    plain, ahead = RobotConfig(radius_m=0.3), RobotConfig(radius_m=0.3, scanner=ScannerSpec(0.25))
    assert world.lookouts(0.3, 0.25).contains(world.lookouts(0.3, 0.0))
    assert not np.any(visible_floor(world, plain) & ~visible_floor(world, ahead))
