"""Scan matching tells the motion between scans, how sure it is, and finds the robot again where wheels have slipped."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.evaluation.consistency import nees
from chainslam.slam.geometry.poses import compose, inverse, wrap
from chainslam.slam.odometry import scan_matching
from chainslam.slam.odometry.config import ScanMatchingConfig
from chainslam.slam.odometry.matched_robot import MatchedRobot
from chainslam.slam.odometry.scan_matching import ScanMatcher
from chainslam.slam.odometry.search_kernels import Window
from chainslam.slam.robot import MotionCommand, Odometry, Robot, Scan, ScannerSpec

ROOM = shapely.box(0, 0, 5, 3.5).difference(shapely.box(2, 2, 2.8, 3.5)).difference(shapely.box(4, 0, 5, 0.6))
CORRIDOR = shapely.box(-50, 0, 50, 2)
AHEAD = ScannerSpec(0.3, -0.1, 0.4)
WHEELS_COV = np.diag([0.05, 0.05, np.deg2rad(3.0)]) ** 2


def faces_of(polygon):
    ring = shapely.get_coordinates(shapely.orient_polygons(polygon).exterior)
    return np.stack([ring[:-1], ring[1:]], axis=1)


def scan_at(polygon, pose, rng=None, sigma=0.01):
    finder = RangeFinder(faces_of(polygon), LidarConfig())
    ranges = finder.cast(np.array(pose))[0]
    if rng is not None:
        ranges = ranges + sigma * rng.standard_normal(len(ranges))
    return Scan(finder.bearings_rad, np.where(ranges < 4.0, ranges, np.inf), sigma, 4.0, 0.0)


def walk(count=30):
    """Poses in the room, about 0.1 m and 8 degrees apart."""
    turn = np.linspace(0.0, 4.0, count)
    return np.column_stack([1.0 + 0.5 * np.sin(turn), 1.2 + 0.3 * np.cos(turn), 0.08 * np.arange(count)])


def matched(poses, polygon, wheels_errors, rng=None, config=None):
    """Motions as matching tells them, and the true ones, for wheels with such errors."""
    matcher = ScanMatcher(config or ScanMatchingConfig())
    matcher.begin(scan_at(polygon, poses[0], rng))
    told, true = [], []
    for before, after, error in zip(poses[:-1], poses[1:], wheels_errors, strict=True):
        true.append(compose(inverse(before), after))
        told.append(matcher.match(scan_at(polygon, after, rng), Odometry(true[-1] + error, WHEELS_COV)))
    return matcher, told, np.array(true)


def errors_of(told, true):
    off = np.array([each.motion for each in told]) - true
    off[:, 2] = wrap(off[:, 2])
    return off


def test_matching_is_far_better_than_the_wheels_and_says_how_good():
    rng = np.random.default_rng(1)
    poses = walk()
    wheels = rng.standard_normal((len(poses) - 1, 3)) * np.sqrt(np.diag(WHEELS_COV))
    _, told, true = matched(poses, ROOM, wheels, rng)
    off = errors_of(told, true)
    assert np.sqrt(np.mean(off[:, :2] ** 2)) < 0.2 * 0.05
    assert np.sqrt(np.mean(off[:, 2] ** 2)) < 0.2 * np.deg2rad(3.0)
    values = nees(off, np.array([each.cov for each in told])) / 3.0
    assert values.mean() < 1.0, (
        "the same scans tell the map its lines: what is stated is less sure than what is reached"
    )
    assert np.sqrt(np.mean([np.trace(each.cov[:2, :2]) / 2 for each in told])) < 0.02


def test_along_a_bare_corridor_the_wheels_have_their_say_and_across_it_the_scans():
    poses = np.column_stack([0.15 * np.arange(6), np.full(6, 0.9), np.zeros(6)])
    wheels = np.tile([0.04, 0.03, 0.03], (5, 1))
    _, told, true = matched(poses, CORRIDOR, wheels)
    off = errors_of(told, true)
    np.testing.assert_allclose(off[:, 0], 0.04, atol=0.015)
    assert np.abs(off[:, 1]).max() < 0.01
    for each in told:
        assert each.cov[0, 0] > 0.7 * WHEELS_COV[0, 0]
        assert each.cov[1, 1] < 0.2 * WHEELS_COV[1, 1]


def test_among_equal_niches_the_one_near_where_the_wheels_say_is_taken(monkeypatch):
    """Scans 1 m apart see another part of the corridor each: the less the robot moved, the more they have in common."""
    niches = [shapely.box(x, 2, x + 0.2, 2.3) for x in np.arange(-8.0, 8.0, 0.5)]
    corridor = shapely.union_all([CORRIDOR, *niches])
    poses = np.column_stack([1.0 * np.arange(6), np.full(6, 0.9), np.zeros(6)])
    wheels = np.tile([0.06, 0.03, 0.03], (5, 1))
    _, told, true = matched(poses, corridor, wheels)
    assert np.abs(errors_of(told, true)).max() < 0.05
    monkeypatch.setattr(scan_matching, "Window", lambda *args: Window(*args[:-1], np.zeros((3, 3))))
    wide = ScanMatchingConfig(gate_sigmas=12.0)
    _, told, true = matched(poses, corridor, wheels, config=wide)
    assert np.abs(errors_of(told, true)).max() > 0.4


@pytest.mark.parametrize("slip_deg", [50.0, -45.0])
def test_a_slip_is_found_out_and_made_good(slip_deg):
    poses = walk()[:12]
    # The robot turns on the spot while its wheels slip, and report next to nothing.
    poses[7:, 2] += np.deg2rad(slip_deg)
    wheels = np.zeros((11, 3))
    wheels[6, 2] = -np.deg2rad(slip_deg)
    matcher, told, true = matched(poses, ROOM, wheels)
    assert matcher.slips == 1
    assert np.abs(errors_of(told, true)).max() < 0.02
    assert all(each.by_scans for each in told)
    narrow = ScanMatchingConfig(slip_rad=np.deg2rad(6.0))
    _, told, true = matched(poses, ROOM, wheels, config=narrow)
    assert np.abs(errors_of(told, true)[6, 2]) > 0.2
    assert not told[6].by_scans


def test_without_returns_the_wheels_are_believed():
    matcher = ScanMatcher()
    blind = Scan(np.linspace(-1, 1, 50), np.full(50, np.inf), 0.01, 4.0, 0.0)
    matcher.begin(blind)
    wheels = Odometry(np.array([0.1, 0.0, 0.1]), WHEELS_COV, touched=True)
    assert matcher.match(blind, wheels) is wheels


def test_a_bumper_is_passed_on():
    matcher = ScanMatcher()
    matcher.begin(scan_at(ROOM, [1.0, 1.0, 0.0]))
    found = matcher.match(scan_at(ROOM, [1.1, 1.0, 0.0]), Odometry(np.array([0.1, 0.0, 0.0]), WHEELS_COV, touched=True))
    assert found.touched


class Scripted:
    """A robot that drives along a list of poses, and counts its scans."""

    def __init__(self, poses):
        self.poses, self.at, self.scans = poses, 0, 0

    def sense(self):
        self.scans += 1
        return scan_at(ROOM, self.poses[self.at])

    def drive(self, command):
        self.at += 1
        motion = compose(inverse(self.poses[self.at - 1]), self.poses[self.at])
        return Odometry(motion + np.array([0.03, 0.0, 0.04]), WHEELS_COV)


def test_a_matched_robot_senses_once_at_each_place_and_hands_that_scan_on():
    poses = walk()[:4]
    inner = Scripted(poses)
    robot = MatchedRobot(inner, ScanMatcher())
    assert isinstance(robot, Robot)
    for k in range(4):
        np.testing.assert_array_equal(robot.sense().ranges_m, scan_at(ROOM, poses[k]).ranges_m)
        assert robot.sense() is robot.sense()
        assert inner.scans == k + 1
        if k < 3:
            odometry = robot.drive(MotionCommand(0.1, 0.0))
            np.testing.assert_allclose(odometry.motion, compose(inverse(poses[k]), poses[k + 1]), atol=0.012)
            assert odometry.reported is odometry.wheels
            np.testing.assert_allclose(odometry.reported.motion - odometry.motion, [0.03, 0.0, 0.04], atol=0.012)


def test_where_the_robot_was_carried_the_matcher_begins_anew_with_the_scan_there():
    poses = walk()[[0, 1, 20, 21]]
    inner, matcher = Scripted(poses), ScanMatcher()
    robot, drive = MatchedRobot(inner, matcher), inner.drive
    robot.sense()
    robot.drive(MotionCommand(0.1, 0.0))
    inner.drive = lambda command: replace(drive(command), carried=True)
    told = robot.drive(MotionCommand(0.1, 0.0))
    assert told.carried
    assert not told.by_scans
    assert told.wheels is None
    np.testing.assert_array_equal(told.motion, compose(inverse(poses[1]), poses[2]) + np.array([0.03, 0.0, 0.04]))
    inner.drive = drive
    told = robot.drive(MotionCommand(0.1, 0.0))
    assert inner.scans == 4
    assert not told.carried
    np.testing.assert_allclose(told.motion, compose(inverse(poses[2]), poses[3]), atol=0.012)


class Mounted(Scripted):
    """The same robot with its scanner ahead of the axle, turned."""

    def sense(self):
        return scan_at(ROOM, compose(self.poses[self.at], AHEAD.pose_robot))


def test_of_a_scanner_off_the_axle_the_motion_is_that_of_the_body():
    poses = walk()[:12]
    told = []
    for scanner in (AHEAD, ScannerSpec()):
        robot = MatchedRobot(Mounted(poses), ScanMatcher(), scanner)
        robot.sense()
        told.append([robot.drive(MotionCommand(0.1, 0.0)) for _ in poses[1:]])
    true = np.array([compose(inverse(before), after) for before, after in pairwise(poses)])
    assert np.abs(errors_of(told[0], true)[:, :2]).max() < 0.012
    assert np.abs(errors_of(told[1], true)[:, :2]).max() > 0.03, "without its place the scanner's own motion is told"


@pytest.mark.parametrize("seed", range(3))
def test_a_scan_with_nothing_in_common_with_those_before_it_takes_the_motion_of_the_wheels(seed):
    """Points strewn at random where the room before was seen free: wherever they are laid, few lie on its walls."""
    rng, matcher = np.random.default_rng(seed), ScanMatcher(ScanMatchingConfig())
    first = scan_at(ROOM, walk()[0])
    matcher.begin(first)
    strewn = Scan(first.bearings_rad, rng.uniform(0.2, 0.6, len(first.ranges_m)), 0.01, 4.0, 0.0)
    wheels = Odometry(np.array([0.1, 0.02, 0.05]), WHEELS_COV)
    told = matcher.match(strewn, wheels)
    np.testing.assert_array_equal(told.motion, wheels.motion)
    np.testing.assert_array_equal(told.cov, wheels.cov)
