"""Returns of the robot's own body: gone by its second scan at the latest, and no wall beside it with them."""

import numpy as np
import pytest

from chainslam.sim.faults import FaultsConfig
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.slam.association.ranges.own_body import OwnBody
from chainslam.slam.robot import MotionCommand, RobotSpec, Scan, ScannerSpec
from tests.sim.test_robot import room

BEARINGS = np.linspace(-np.pi, np.pi, 180, endpoint=False)


def scan_of(ranges):
    return Scan(BEARINGS, ranges, 0.01, 4.0, 0.0)


@pytest.mark.parametrize("post_m", [0.1, 0.15])
def test_posts_of_the_body_tell_nothing_and_all_else_stays(post_m):
    config = RobotConfig(faults=FaultsConfig(posts=4, post_m=post_m))
    robot, body, left = SimulatedRobot(room(), 3, config=config), OwnBody(config.spec, 4.0), []
    for _ in range(12):
        sensed = robot.sense()
        scan, count = body.without(sensed)
        gone = np.isnan(scan.ranges_m) & ~np.isnan(sensed.ranges_m)
        assert np.count_nonzero(gone) == count
        assert np.all(sensed.ranges_m[gone] < 0.2)
        np.testing.assert_array_equal(scan.ranges_m[~gone], sensed.ranges_m[~gone])
        left.append(np.count_nonzero(scan.ranges_m < 0.2))
        robot.drive(MotionCommand(0.05, 0.1))
    assert sum(left[2:]) == 0
    assert left[0] <= 2
    assert count == np.count_nonzero(sensed.ranges_m < 0.2) > 8


def test_a_wall_that_noise_draws_into_the_body_is_still_a_wall():
    rng, body = np.random.default_rng(1), OwnBody(RobotSpec(), 4.0)
    wall = np.where(np.abs(BEARINGS) < 1.2, 0.21 / np.cos(np.clip(BEARINGS, -1.3, 1.3)), 3.0)
    for _ in range(50):
        scan, count = body.without(scan_of(wall + 0.01 * rng.standard_normal(180)))
        assert count == 0
    assert np.any(scan.ranges_m < 0.2)


def test_the_scanner_may_sit_at_the_edge_of_a_long_body():
    """A return half a metre behind a scanner at the front is of the body, one half a metre ahead is not."""
    outline = ((0.4, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.4, -0.2))
    robot = RobotSpec(outline_m=outline, scanner=ScannerSpec(x_m=0.35))
    ranges = np.full(180, 2.0)
    ranges[0], ranges[90], ranges[135] = 0.5, 0.5, 0.19
    scan, count = OwnBody(robot, 4.0).without(scan_of(ranges))
    assert count == 1
    assert np.flatnonzero(np.isnan(scan.ranges_m)).tolist() == [0]
