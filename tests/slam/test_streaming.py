"""Streaming robots: scans taken in motion against rays from where the scanner truly was, and what stops a robot."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.poses import arc, compose, inverse
from chainslam.slam.robot import MotionCommand, Odometry, RobotError, Scan
from chainslam.slam.robot.streaming import SteppedRobot, TimedScan, Twist, de_skewed
from tests.slam.streaming_base import COV, ranges_from

BEARINGS = np.linspace(-np.pi, np.pi, 360, endpoint=False)


class Streaming:
    """A disc that obeys at once, whose scanner takes 0.1 s for a turn; it counts what it was told."""

    def __init__(self, pose=(1.0, 1.0, 0.0), sigma_m=0.0, obeys=True, clockwise=False, seed=0):
        self.pose, self.time_s, self.twist = np.array(pose, dtype=float), 0.0, Twist(0.0, 0.0)
        self.track, self.stops, self.sent, self.obeys = [(0.0, self.pose.copy())], 0, [], obeys
        self.sigma_m, self.rng, self.clockwise = sigma_m, np.random.default_rng(seed), clockwise
        self.breaks = False

    def true_at(self, time_s):
        times = np.array([t for t, _ in self.track])
        k = int(np.clip(np.searchsorted(times, time_s, side="right") - 1, 0, len(times) - 2)) if len(times) > 1 else 0
        if len(times) == 1:
            return self.track[0][1]
        (t0, a), (t1, b) = self.track[k], self.track[k + 1]
        motion = compose(inverse(a), b)
        return compose(a, motion * np.clip((time_s - t0) / (t1 - t0), 0.0, 1.0))

    def scan(self):
        if self.breaks:
            raise OSError("the scanner does not answer")
        poses, start = [], self.time_s
        for _ in BEARINGS:
            step = 0.1 / len(BEARINGS)
            moved = arc(self.twist.speed_m_s * step, self.twist.turn_rad_s * step) if self.obeys else np.zeros(3)
            self.pose, self.time_s = compose(self.pose, moved), self.time_s + step
            poses.append(self.pose)
        self.track.append((self.time_s, self.pose.copy()))
        bearings = BEARINGS[::-1] if self.clockwise else BEARINGS
        ranges = ranges_from(np.array(poses), bearings) + self.sigma_m * self.rng.standard_normal(len(BEARINGS))
        return TimedScan(bearings, np.where(ranges < 8.0, ranges, np.inf), 0.01, 8.0, start, self.time_s)

    def odometry(self, from_s, to_s):
        return Odometry(compose(inverse(self.true_at(from_s)), self.true_at(to_s)), COV)

    def send(self, twist):
        self.sent.append(twist)
        self.twist = twist

    def stop(self):
        self.stops += 1
        self.twist = Twist(0.0, 0.0)


@settings(max_examples=12, deadline=None)
@given(st.floats(-0.5, 0.5), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0), st.booleans())
def test_a_scan_taken_in_motion_is_as_if_it_had_been_taken_at_its_end(speed, turn, heading, clockwise):
    robot = Streaming((1.6, 1.1, heading), clockwise=clockwise)
    robot.send(Twist(speed, turn))
    taken = robot.scan()
    scan = de_skewed(taken, robot.odometry)
    true = ranges_from(np.tile(robot.pose, (360, 1)), scan.bearings_rad)
    off = np.abs(scan.ranges_m - true)
    assert scan.time_s == taken.end_s
    assert np.nanquantile(off, 0.97) < 0.005, "but at the corners where a range jumps"
    assert np.isnan(off).mean() < 0.05


def test_without_it_a_turning_robot_sees_its_walls_bent():
    robot = Streaming((1.6, 1.1, 0.3))
    robot.send(Twist(0.0, 1.5))
    taken = robot.scan()
    true = ranges_from(np.tile(robot.pose, (360, 1)), BEARINGS)
    assert np.quantile(np.abs(taken.ranges_m - true), 0.9) > 0.1
    assert np.nanquantile(np.abs(de_skewed(taken, robot.odometry).ranges_m - true), 0.9) < 0.005


def test_what_came_back_from_nowhere_stays_free_and_what_is_not_known_stays_unknown():
    robot = Streaming((1.6, 1.1, 0.3))
    robot.send(Twist(0.2, 0.5))
    taken = robot.scan()
    ranges = taken.ranges_m.copy()
    ranges[100:120], ranges[200:220] = np.inf, np.nan
    scan = de_skewed(TimedScan(taken.bearings_rad, ranges, 0.01, 8.0, taken.start_s, taken.end_s), robot.odometry)
    assert np.isposinf(scan.ranges_m).sum() == pytest.approx(20, abs=2)
    assert np.isnan(scan.ranges_m).sum() == pytest.approx(18, abs=3)
    blind = TimedScan(taken.bearings_rad, np.full(360, np.nan), 0.01, 8.0, taken.start_s, taken.end_s)
    assert np.isnan(de_skewed(blind, robot.odometry).ranges_m).all()


def test_at_rest_a_scan_is_what_came():
    robot = Streaming(sigma_m=0.01)
    taken = robot.scan()
    np.testing.assert_array_equal(de_skewed(taken, robot.odometry).ranges_m, taken.ranges_m)


@pytest.mark.parametrize("command", [MotionCommand(0.15, 0.0), MotionCommand(0.1, 0.17), MotionCommand(0.0, -0.17)])
def test_a_command_is_driven_to_its_end_and_the_robot_stands_after_it(command):
    robot = Streaming()
    stepped = SteppedRobot(robot)
    first = stepped.sense()
    start = robot.pose.copy()
    odometry = stepped.drive(command)
    np.testing.assert_allclose(odometry.motion, arc(command.forward_m, command.turn_rad), atol=0.004)
    np.testing.assert_allclose(compose(start, odometry.motion), robot.pose, atol=1e-9)
    assert robot.twist == Twist(0.0, 0.0)
    scan = stepped.sense()
    assert scan.time_s > first.time_s
    assert stepped.sense().time_s == scan.time_s, "one scan a step"
    np.testing.assert_allclose(scan.ranges_m, ranges_from(np.tile(robot.pose, (360, 1)), BEARINGS), atol=1e-9)
    assert max(abs(t.speed_m_s) for t in robot.sent) <= 0.2 + 1e-9


@pytest.mark.parametrize("raised", [OSError, KeyboardInterrupt])
def test_whatever_goes_wrong_the_robot_is_stopped_first(raised, monkeypatch):
    robot = Streaming()
    stepped = SteppedRobot(robot)
    stepped.sense()

    def breaks():
        raise raised("no answer")

    monkeypatch.setattr(robot, "scan", breaks)
    with pytest.raises(raised):
        stepped.drive(MotionCommand(0.15, 0.0))
    assert robot.twist == Twist(0.0, 0.0)
    assert robot.stops == 1
    fresh = SteppedRobot(robot)
    with pytest.raises(raised):
        fresh.sense()
    assert robot.stops == 2


def test_what_is_no_scan_is_refused():
    robot = Streaming()
    taken = robot.scan()
    zeros = TimedScan(taken.bearings_rad, np.zeros(360), 0.01, 8.0, taken.start_s, taken.end_s)
    with pytest.raises(RobotError, match="at 0 or below"):
        de_skewed(zeros, robot.odometry)
    assert isinstance(de_skewed(taken, robot.odometry), Scan)


def test_a_scan_of_a_streaming_robot_keeps_its_times_its_noise_and_its_minimum_range():
    ranges = np.where(np.arange(360) < 20, 0.05, 2.0)
    taken = TimedScan(BEARINGS, ranges, 0.01, 8.0, 3.0, 3.1, range_min_m=0.1, sigma_share=0.02)
    for motion in (np.zeros(3), np.array([0.02, 0.0, 0.01])):
        scan = de_skewed(taken, lambda from_s, to_s, motion=motion: Odometry((to_s - from_s) / 0.1 * motion, COV))
        assert (scan.start_s, scan.time_s, scan.sigma_share) == (3.0, 3.1, 0.02)
        assert np.isnan(scan.ranges_m[5:15]).all()
        assert np.isfinite(scan.ranges_m[30:-30]).all()
