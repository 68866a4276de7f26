"""Scan matching tells the motion between scans, how sure it is, and finds the robot again where wheels have slipped."""

import numpy as np
import pytest
import shapely

from sim.lidar import LidarConfig, RangeFinder
from slam.evaluation.consistency import nees
from slam.geometry.poses import compose, inverse, to_world, wrap
from slam.odometry.config import ScanMatchingConfig
from slam.odometry.likelihood_field import field_of, joined, surface_normals, thinned
from slam.odometry.matched_robot import MatchedRobot
from slam.odometry.scan_matching import ScanMatcher
from slam.odometry.search import Window, correlate, placed, refine
from slam.robot import MotionCommand, Odometry, Robot, Scan

ROOM = shapely.box(0, 0, 5, 3.5).difference(shapely.box(2, 2, 2.8, 3.5)).difference(shapely.box(4, 0, 5, 0.6))
CORRIDOR = shapely.box(-50, 0, 50, 2)
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
    narrow = ScanMatchingConfig(slip_rad=np.deg2rad(6.0))
    _, told, true = matched(poses, ROOM, wheels, config=narrow)
    assert np.abs(errors_of(told, true)[6, 2]) > 0.2


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


def brute_field(points, at, kernel):
    return np.exp(-0.5 * (np.hypot(*(at[:, None] - points).transpose(2, 0, 1)).min(axis=1) / kernel) ** 2)


def test_the_field_is_the_kernel_of_the_nearest_point():
    rng = np.random.default_rng(2)
    points = rng.uniform(-1.0, 1.0, (30, 2))
    field = field_of(points, np.zeros(2), 1.5, 0.05, 0.06, 4)
    rows, columns = np.indices(field.values.shape)
    middles = field.corner + 0.05 * np.stack([columns, rows], axis=-1).reshape(-1, 2)
    truth = brute_field(points, middles, 0.06).reshape(field.values.shape)
    near = truth > np.exp(-0.5 * 2.3**2)
    np.testing.assert_allclose(field.values[near], truth[near], atol=1e-12)
    assert np.all(field.values <= truth + 1e-12)
    np.testing.assert_allclose(field.at(middles[:50]), field.values.ravel()[:50], atol=1e-12)
    assert not field.at(np.array([[99.0, 0.0], [0.0, -99.0]])).any()


def test_the_search_finds_what_trying_each_pose_by_itself_finds():
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.0, 1.0, (60, 2))
    field = field_of(to_world(points, np.array([0.1, -0.05, 0.07])), np.zeros(2), 1.6, 0.05, 0.06, 6)
    window = Window(np.zeros(3), 0.2, 0.12, 0.02, 0.02)
    found, score = correlate(field, points, window)
    tried = [
        [dx, dy, turn]
        for dx in np.arange(-4, 5) * 0.05 for dy in np.arange(-4, 5) * 0.05 for turn in np.arange(-6, 7) * 0.02
    ]  # fmt: skip
    each = []
    for pose in np.array(tried):
        rows, columns = field.cells(placed(points, np.array([[0.0, 0.0, pose[2]]]))[0])
        rows, columns = rows + round(pose[1] / 0.05), columns + round(pose[0] / 0.05)
        far = (pose[0] ** 2 + pose[1] ** 2) / 0.2**2 + pose[2] ** 2 / 0.12**2
        each.append(field.values[rows, columns].mean() - 0.02 * far)
    np.testing.assert_allclose(found, tried[int(np.argmax(each))], atol=1e-12)
    fine, better = refine(field, points, found, 0.02, 0.001)
    assert better > score - 0.05
    np.testing.assert_allclose(fine, [0.1, -0.05, 0.07], atol=0.006)


def test_a_surface_is_told_by_its_neighbours_on_both_sides():
    wall = np.column_stack([np.linspace(0, 1, 11), 0.5 * np.linspace(0, 1, 11)])
    points = np.concatenate([wall, [[5.0, 5.0]], wall[::-1] + 9.0])
    normals, known = surface_normals(points, 0.5)
    np.testing.assert_array_equal(np.flatnonzero(known), [*range(3, 8), *range(15, 20)])
    np.testing.assert_allclose(np.abs(normals[known] @ [2.0, 1.0]), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.hypot(*normals[known].T), 1.0)
    assert not surface_normals(points[:6], 0.5)[1].any()


def test_neighbouring_returns_of_one_surface_are_joined_and_others_are_not():
    points = np.array([[0.0, 0.0], [0.2, 0.0], [1.0, 0.0], [1.0, 0.1]])
    expected = [[0, 0], [0.05, 0], [0.1, 0], [0.15, 0], [0.2, 0], [1, 0], [1, 0.05], [1, 0.1]]
    np.testing.assert_allclose(joined(points, 0.05, 0.3), expected, atol=1e-12)
    for few in (points[:0], points[:1]):
        np.testing.assert_array_equal(joined(few, 0.05, 0.3), few)


def test_thinning_keeps_the_last_point_of_each_cell():
    points = np.array([[0.01, 0.01], [0.04, 0.04], [0.06, 0.01], [-0.01, 0.01], [0.02, 0.03]])
    kept = {tuple(point) for point in thinned(points, 0.05)}
    assert kept == {(0.02, 0.03), (0.06, 0.01), (-0.01, 0.01)}
