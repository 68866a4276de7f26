from dataclasses import dataclass, replace

import numpy as np
import pytest

from chainslam.sim.kernels import clear_places
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.robot import MotionCommand, Robot, ScannerSpec, WheelSpec


@dataclass(frozen=True)
class Room:
    """A square room of 4 m with its corner at the origin."""

    faces: np.ndarray
    start: np.ndarray


def room(heading=0.0):
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    return Room(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), np.array([2.0, 2.0, heading]))


def test_the_simulated_robot_is_a_robot():
    robot: Robot = SimulatedRobot(room(), seed=1)
    assert robot.sense().ranges_m.shape == (180,)


@pytest.mark.parametrize("sides", [127, 128, 129, 300])
def test_every_beam_keeps_its_face_however_many_there_are(sides):
    """A round room; the record takes as few bytes for a face as the count of faces allows."""
    turn = np.linspace(-np.pi, np.pi, sides, endpoint=False)
    corners = 2.0 + 2.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    faces = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    robot = SimulatedRobot(Room(faces, np.array([2.0, 2.0, 0.01])), seed=1, errorless=True)
    scan = robot.sense()
    bearings = scan.bearings_rad + 0.01
    ends = 2.0 + scan.ranges_m[:, None] * np.column_stack([np.cos(bearings), np.sin(bearings)])
    nearest = [int(np.argmin(np.hypot(*(faces.mean(axis=1) - end).T))) for end in ends]
    np.testing.assert_array_equal(robot.record.faces_of_beams[0], nearest)


def test_errorless_wheels_go_where_they_are_told_and_state_their_noise():
    robot = SimulatedRobot(room(), seed=1, errorless=True)
    odometry = robot.drive(MotionCommand(0.1, 0.1))
    noisy = SimulatedRobot(room(), seed=1).drive(MotionCommand(0.1, 0.1))
    np.testing.assert_array_equal(odometry.cov, noisy.cov)
    np.testing.assert_allclose(robot.true_pose[:2] - 2.0, odometry.motion[:2], atol=1e-12)


def test_errorless_ranges_are_exact():
    robot = SimulatedRobot(room(), seed=1, errorless=True)
    scan = robot.sense()
    ahead = np.argmin(np.abs(scan.bearings_rad))
    assert scan.ranges_m[ahead] == pytest.approx(2.0, abs=1e-9)


def test_the_same_seed_gives_the_same_bytes_and_wheels_never_shift_the_laser():
    one, two = SimulatedRobot(room(), seed=5), SimulatedRobot(room(), seed=5)
    for robot in (one, two):
        robot.sense()
        robot.drive(MotionCommand(0.1, 0.0))
    assert one.true_pose.tobytes() == two.true_pose.tobytes()
    assert one.sense().ranges_m.tobytes() == two.sense().ranges_m.tobytes()
    still, turning = SimulatedRobot(room(), seed=5), SimulatedRobot(room(), seed=5)
    still.sense(), turning.sense()
    turning.drive(MotionCommand(0.0, 0.0))
    assert still.sense().ranges_m.tobytes() == turning.sense().ranges_m.tobytes()


@pytest.mark.parametrize("heading", [0.0, 0.3, 0.8, 2.0])
def test_the_body_stops_before_the_wall_and_the_collision_is_counted(heading):
    robot = SimulatedRobot(room(heading), seed=2)
    touched = [robot.drive(MotionCommand(0.15, 0.0)).touched for _ in range(30)]
    assert robot.record.collisions == sum(touched) > 0
    assert not touched[0]
    gap = distance_to_segments(robot.true_pose[None, :2], room().faces).min()
    assert 0.2 <= gap < 0.35


@pytest.mark.parametrize("turn_rad", [0.0, 0.1])
def test_wheels_that_a_wall_stopped_report_the_part_that_was_driven(turn_rad):
    """From 1.92 m the body of 0.2 m may go on by 0.08 m of the 0.15 m that are left to the wall at 2.2 m."""
    near = Room(room().faces, np.array([3.72, 2.0, 0.0]))
    robot = SimulatedRobot(near, seed=1, errorless=True)
    odometry = robot.drive(MotionCommand(0.15, turn_rad))
    way = robot.true_pose - near.start
    assert robot.record.collisions == 1
    assert 0.075 - 1e-9 <= way[0] <= 0.08
    np.testing.assert_allclose(odometry.motion, way, atol=1e-12)
    assert odometry.motion[2] == pytest.approx(turn_rad * np.hypot(*way[:2]) / 0.15, rel=1e-2)
    # The covariance, the clock and the length are those of this part, too.
    free = SimulatedRobot(room(), seed=1, errorless=True)
    share = robot.record.drive_time_s / 0.5 if turn_rad == 0.0 else way[2] / turn_rad
    expected = free.drive(MotionCommand(0.15 * share, turn_rad * share))
    np.testing.assert_allclose(odometry.cov, expected.cov, rtol=1e-9)
    assert robot.record.drive_time_s == pytest.approx(free.record.drive_time_s)
    assert robot.record.path_length_m == pytest.approx(np.hypot(*way[:2]))
    # Where nothing is left to go, nothing is reported: the next command finds the body at the wall.
    again = robot.drive(MotionCommand(0.15, 0.0))
    assert robot.record.collisions == 2
    assert np.abs(again.motion).max() <= 0.005 + 1e-9
    np.testing.assert_allclose(robot.drive(MotionCommand(0.15, 0.0)).motion, 0.0, atol=1e-12)


def test_no_collision_far_from_every_wall():
    robot = SimulatedRobot(room(), seed=2)
    for _ in range(72):
        robot.drive(MotionCommand(0.02, 0.17))
    assert robot.record.collisions == 0


def test_a_long_command_is_shortened():
    robot = SimulatedRobot(room(), seed=1, errorless=True)
    assert robot.drive(MotionCommand(2.0, 0.0)).motion[0] == pytest.approx(0.15)


def test_time_goes_on_and_the_record_follows_the_scans():
    robot = SimulatedRobot(room(), seed=1)
    first = robot.sense()
    robot.drive(MotionCommand(0.15, 0.0))
    second = robot.sense()
    assert second.time_s == pytest.approx(first.time_s + 0.5 + 0.1)
    assert robot.record.drive_time_s == pytest.approx(0.5)
    assert len(robot.record.poses_world) == len(robot.record.faces_of_beams) == 2
    assert np.all((robot.record.faces_of_beams[0] >= 0) == np.isfinite(first.ranges_m))


def test_way_and_time_of_the_record_add_up_over_all_drives():
    robot, way, times = SimulatedRobot(room(), seed=2), 0.0, []
    for _ in range(4):
        before = robot.true_pose
        robot.drive(MotionCommand(0.1, 0.3))
        way += np.hypot(*(robot.true_pose - before)[:2])
        times.append(robot.record.drive_time_s)
    assert robot.record.path_length_m == pytest.approx(way)
    assert times == pytest.approx(times[0] * np.arange(1, 5))
    assert times[0] > 0.0


def test_a_body_touches_what_is_in_its_way_from_anywhere():
    """The robot looks at the faces about the cell that it is in alone: a post before it, all over a plane.

    Where it stops it touches nothing, and it stops where its way would lead into the post.
    """
    rng, touched = np.random.default_rng(4), 0
    for seed in range(150):
        start = np.append(rng.uniform(-4.0, 4.0, 2), rng.uniform(-np.pi, np.pi))
        radius, toward = RobotConfig().radius_m, start[2] + rng.uniform(-0.8, 0.8)
        at = start[:2] + (radius + rng.uniform(0.02, 0.2)) * np.array([np.cos(toward), np.sin(toward)])
        post = np.array([[at, at + np.array([0.01, 0.0])]])
        robot = SimulatedRobot(Room(post, start), seed, errorless=True)
        told = robot.drive(MotionCommand(0.15, 0.0))
        way = start[:2] + np.linspace(0.0, 0.15, 301)[:, None] * [np.cos(start[2]), np.sin(start[2])]
        clear = distance_to_segments(way, post).min()
        assert distance_to_segments(robot.true_pose[None, :2], post).min() >= radius
        if abs(clear - radius) > 1e-3:
            assert told.touched == (clear < radius)
            touched += told.touched
    assert 50 < touched < 140


def test_places_are_clear_up_to_the_first_that_is_too_near_to_a_face_or_a_person():
    rng, found = np.random.default_rng(5), []
    for k in range(200):
        places, faces, people = (
            rng.uniform(-3, 3, (8, 2)),
            rng.uniform(-3, 3, (k % 4, 2, 2)),
            rng.uniform(-3, 3, (k % 3, 2)),
        )
        to_people = np.hypot(*np.moveaxis(places[:, None] - people, -1, 0)).min(axis=1, initial=np.inf)
        near = (distance_to_segments(places, faces).min(axis=1, initial=np.inf) < 0.4) | (to_people < 0.4 + 0.3)
        found.append(clear_places(places, faces, 0.4, people, 0.3))
        assert found[-1] == (np.argmax(near) if near.any() else 8)
    assert set(found) == set(range(9))


def test_a_scanner_off_the_axle_sees_from_where_it_sits():
    config = RobotConfig(scanner=ScannerSpec(0.1, 0.0, 0.0))
    scan = SimulatedRobot(room(), seed=1, errorless=True, config=config).sense()
    ahead, behind = np.argmin(np.abs(scan.bearings_rad)), np.argmax(np.abs(scan.bearings_rad))
    assert scan.ranges_m[[ahead, behind]] == pytest.approx([1.9, 2.1], abs=1e-9)


def test_a_long_body_stops_where_its_corner_meets_a_wall():
    """It stands 0.25 m beside a wall, 0.2 m wide to that side: it may drive along, and turn by 7 degrees only."""
    outline = ((0.4, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.4, -0.2))
    config = RobotConfig(outline_m=outline, turn_rad=0.6, wheels=WheelSpec(slip=0.0, lateral_slip=0.0))
    world = room()
    corners = world.faces.reshape(-1, 2)
    beside = replace(world, start=np.array([corners[:, 0].mean(), corners[:, 1].min() + 0.25, 0.0]))
    robot = SimulatedRobot(beside, 1, config=config)
    assert not robot.drive(MotionCommand(0.1, 0.0)).touched
    assert robot.drive(MotionCommand(0.0, 0.6)).touched
    assert robot.record.collisions == 1
    assert 0.2 * np.cos(robot.true_pose[2]) + 0.4 * np.sin(robot.true_pose[2]) < 0.25
