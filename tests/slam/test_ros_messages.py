"""Messages of ROS by their fields: scans of every kind of driver, frames, odometry, a robot made of them."""

import threading
import time

import numpy as np
import pytest

from chainslam.slam.geometry.poses import arc, compose, inverse
from chainslam.slam.robot import MotionCommand, RobotError, WheelSpec
from chainslam.slam.robot.deskew import de_skewed
from chainslam.slam.robot.messages import Odometry
from chainslam.slam.robot.ros.laser_scan import is_covered, timed_scan
from chainslam.slam.robot.ros.odometry_buffer import OdometryBuffer
from chainslam.slam.robot.ros.robot import CancelledError, MessageRobot, map_to_odom
from chainslam.slam.robot.ros.transforms import Frames, planar, seconds
from chainslam.slam.robot.ros.written import written_transform, written_twist
from chainslam.slam.robot.streaming import SteppedRobot, Twist
from tests.slam.message_base import Message, MessageBase, laser_scan, odometry, stamp, transforms
from tests.slam.streaming_base import ranges_from


def rests(from_s, to_s):
    return Odometry(np.zeros(3), np.zeros((3, 3)))


def test_a_scan_says_of_each_beam_what_came_back():
    ranges = [0.0, 0.05, 2.0, np.inf, 8.0, 9.0, np.nan, -np.inf]
    scan = timed_scan(laser_scan(3.25, ranges, low=-0.4, step=0.1))
    told = [np.nan, np.nan, 2.0, np.inf, np.inf, np.inf, np.nan, np.nan]
    np.testing.assert_array_equal(scan.ranges_m, told)
    np.testing.assert_allclose(scan.bearings_rad, -0.4 + 0.1 * np.arange(8))
    assert (scan.start_s, scan.end_s, scan.range_max_m) == (3.25, 3.25, 8.0)
    near = timed_scan(laser_scan(3.25, [0.0, 5e-4, 0.05], low=-0.4, step=0.1, range_min=0.0))
    np.testing.assert_array_equal(near.ranges_m, [np.nan, np.nan, 0.05])


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize("step", [0.1, -0.1])
@pytest.mark.parametrize("beam_s", [0.0, 0.002, -0.002])
def test_beams_of_any_order_become_the_same_scan(beam_s, step, upside_down):
    scan = timed_scan(laser_scan(5.0, [1.0, 2.0, 3.0], low=-step, step=step, time_increment=beam_s), upside_down)
    assert (scan.start_s, scan.end_s) == pytest.approx((5.0 + min(2 * beam_s, 0.0), 5.0 + max(2 * beam_s, 0.0)))
    first_is_right = (step > 0.0) != upside_down
    plain = de_skewed(scan, rests)
    np.testing.assert_allclose(plain.bearings_rad, [-0.1, 0.0, 0.1], atol=1e-12)
    np.testing.assert_array_equal(plain.ranges_m, [1.0, 2.0, 3.0] if first_is_right else [3.0, 2.0, 1.0])
    taken_first = scan.ranges_m[0]
    assert taken_first == (3.0 if beam_s < 0.0 else 1.0)


def test_times_between_beams_that_cannot_be_count_for_none_and_a_turn_is_told_once():
    scan = timed_scan(laser_scan(5.0, np.ones(361), step=np.deg2rad(1.0), time_increment=0.1))
    assert scan.end_s == 5.0
    assert len(scan.ranges_m) == 360
    assert timed_scan(laser_scan(5.0, np.ones(9), step=0.1, time_increment=np.nan)).end_s == 5.0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"step": 0.0}, "expected beams, found 5 of them 0 rad apart"),
        ({"low": np.nan}, "expected beams"),
        ({"range_max": np.inf}, "expected the scanner's maximum range, found inf m"),
    ],
)
def test_a_message_that_is_no_scan_is_refused(fields, words):
    with pytest.raises(RobotError, match=words):
        timed_scan(laser_scan(1.0, np.ones(5), **fields))


def test_a_scanner_inside_something_sees_it_on_both_sides():
    beams = np.arange(180)
    assert is_covered(laser_scan(1.0, np.where(beams % 3, 0.05, 0.4)))
    assert not is_covered(laser_scan(1.0, np.where(beams < 90, 0.05, 2.0))), "beside a wall"
    assert not is_covered(laser_scan(1.0, np.where(beams % 90 < 2, 0.05, 2.0))), "four beams and those opposite"
    assert not is_covered(laser_scan(1.0, np.zeros(180))), "a driver's word for nothing"
    assert not is_covered(laser_scan(1.0, np.full(60, 0.05), low=-0.5, step=1.0 / 60)), "a sector has no opposite side"


def test_times_of_both_kinds_of_ros():
    assert seconds(Message(secs=2, nsecs=500_000_000)) == 2.5
    assert seconds(stamp(2.5)) == 2.5


def test_frames_lead_from_the_scanner_to_the_body():
    frames = Frames()
    frames.take(transforms("base_link", "plate", (0.2, 0.0, 0.0)))
    assert frames.take(transforms("odom", "base_link", (1.0, 2.0, 0.5), time_s=3.0))[0][0] == 3.0
    assert not frames.tells("laser")
    frames.take(transforms("/plate", "/laser", (0.0, 0.1, 0.5), over=True))
    assert frames.tells("laser")
    pose, over = frames.on_body("laser")
    np.testing.assert_allclose(pose, (0.2, 0.1, 0.5), atol=1e-12)
    assert over
    frames.take(transforms("laser", "plate", (0.0, 0.0, 0.0)))
    assert not frames.tells("laser"), "a circle ends"


def test_a_buffer_is_asked_for_any_time_and_takes_poses_in_any_order():
    rng, poses = np.random.default_rng(2), {}
    buffer = OdometryBuffer()
    for time_s in rng.permutation(np.arange(0.0, 5.0, 0.02)):
        poses[time_s] = arc(0.3 * time_s, 0.5 * time_s)
        buffer.add(float(time_s), poses[time_s])
    for time_s in rng.uniform(0.0, 4.9, 50):
        np.testing.assert_allclose(buffer.pose(time_s), arc(0.3 * time_s, 0.5 * time_s), atol=1e-4)
    np.testing.assert_allclose(buffer.motion(1.0, 3.0), arc(0.6, 1.0), atol=1e-4)
    np.testing.assert_allclose(buffer.pose(99.0), poses[max(poses)])
    np.testing.assert_allclose(buffer.pose(-1.0), poses[min(poses)])


def test_a_buffer_forgets_what_is_old():
    buffer = OdometryBuffer(held_s=1.0)
    for k in range(5000):
        buffer.add(0.01 * k, np.array([0.01 * k, 0.0, 0.0]))
    assert len(buffer) <= 1101
    np.testing.assert_allclose(buffer.pose(49.505)[0], 49.505)


def test_the_covariance_of_many_short_ways_is_that_of_drives_with_slip():
    """Against drawn drives: each short motion slips by itself."""
    wheels, rng = WheelSpec(), np.random.default_rng(5)
    steps = [(0.02, 0.03)] * 25 + [(-0.02, 0.01)] * 15
    poses = [np.zeros(3)]
    for forward, turn in steps:
        poses.append(compose(poses[-1], arc(forward, turn)))
    told = wheels.along(np.array(poses))
    ends = np.zeros((20000, 3))
    for forward, turn in steps:
        left, right, aside = np.sqrt(wheels.slip_variances(forward, turn))[:, None] * rng.standard_normal((3, 20000))
        way, angle = forward + 0.5 * (left + right), turn + (right - left) / wheels.base_m
        middle = ends[:, 2] + 0.5 * angle
        ends[:, 0] += way * np.cos(middle) - aside * np.sin(middle)
        ends[:, 1] += way * np.sin(middle) + aside * np.cos(middle)
        ends[:, 2] += angle
    np.testing.assert_allclose(told.motion, poses[-1], atol=1e-12)
    drawn = np.cov(ends.T)
    sigmas = np.sqrt(drawn.diagonal())
    np.testing.assert_allclose(told.cov / np.outer(sigmas, sigmas), drawn / np.outer(sigmas, sigmas), atol=0.05)


def test_two_encoders_tell_an_arc():
    told = WheelSpec(base_m=0.4).odometry(0.1, 0.14)
    np.testing.assert_allclose(told.motion, arc(0.12, 0.1))
    assert np.linalg.eigvalsh(told.cov).min() > 0.0


@pytest.mark.parametrize("encoders", [False, True])
@pytest.mark.parametrize("over", [False, True])
def test_a_robot_of_messages_drives_what_it_is_told(over, encoders):
    base = MessageBase(over=over, encoders=encoders, noise_m=0.0)
    robot = MessageRobot(base.twist)
    base.hear(robot)
    base.in_its_time(robot)
    spec = robot.spec("base_link")
    np.testing.assert_allclose(spec.scanner.pose_robot, base.place, atol=1e-12)
    stepped = SteppedRobot(robot, clock=base.base.clock)
    stepped.sense()
    before = base.base.pose.copy()
    odometry = stepped.drive(MotionCommand(0.12, 0.1))
    np.testing.assert_allclose(odometry.motion, compose(inverse(before), base.base.pose), atol=2e-3)
    np.testing.assert_allclose(odometry.motion, arc(0.12, 0.1), atol=0.015)
    assert 0.0 < odometry.cov[0, 0] < 0.02**2
    scan = stepped.sense()
    pose = compose(base.base.pose, base.place)
    np.testing.assert_allclose(scan.ranges_m, ranges_from(np.tile(pose, (180, 1)), scan.bearings_rad), atol=1e-6)


def test_a_cancel_stops_the_robot_and_ends_what_waits():
    told, robot = [], MessageRobot(lambda twist: told.append(twist), wait_s=20.0)
    threading.Timer(0.1, robot.cancel).start()
    before_s = time.monotonic()
    with pytest.raises(CancelledError, match="a cancel"):
        SteppedRobot(robot).sense()
    assert time.monotonic() - before_s < 10.0
    assert {(twist.speed_m_s, twist.turn_rad_s) for twist in told} == {(0.0, 0.0)}
    robot.send(type(told[0])(0.2, 0.0))
    assert told[-1].speed_m_s == 0.0


def test_what_never_comes_is_told():
    robot = MessageRobot(lambda twist: None, wait_s=0.02)
    assert robot.scan() is None
    with pytest.raises(TimeoutError, match=r"no odometry up to 1\.000 s"):
        robot.odometry(0.0, 1.0)
    robot.on_scan(laser_scan(1.0, np.ones(180)))
    with pytest.raises(RobotError, match=r"expected a transform from base_link to laser, found none in 0\.02 s"):
        robot.spec("base_link", wait_s=0.02)
    robot.on_odometry(odometry(1.0, np.zeros(3)))
    robot.on_scan(laser_scan(1.1, np.where(np.arange(180) % 3, 0.05, 0.4)))
    assert robot.covered == 1


def test_the_frame_of_the_odometry_lies_in_the_map_where_both_poses_agree():
    in_map, in_odom = np.array([1.0, 2.0, 0.7]), np.array([-0.5, 0.3, 2.0])
    np.testing.assert_allclose(compose(map_to_odom(in_map, in_odom), in_odom), in_map)


def test_what_goes_out_fills_the_messages_that_ros_makes():
    drive = written_twist(Message(linear=Message(x=0.0), angular=Message(z=0.0)), Twist(0.2, -0.3))
    assert (drive.linear.x, drive.angular.z) == (0.2, -0.3)
    empty = transforms("", "", np.zeros(3)).transforms[0]
    filled = written_transform(empty, "map", "odom", np.array([1.0, -2.0, 2.5]), 7.25)
    assert (filled.header.frame_id, filled.child_frame_id, seconds(filled.header.stamp)) == ("map", "odom", 7.25)
    np.testing.assert_allclose(planar(filled.transform.translation, filled.transform), [1.0, -2.0, 2.5])
    old = Message(header=Message(stamp=Message(secs=0, nsecs=0), frame_id=""), transform=empty.transform)
    assert seconds(written_transform(old, "map", "odom", np.zeros(3), 7.25).header.stamp) == 7.25
