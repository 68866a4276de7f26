"""Faults that a simulated robot does not know of: as many as asked for, and no other draw is shifted."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.sim.chance import Chance
from chainslam.sim.drive import Slip, seconds
from chainslam.sim.faults import (
    FaultsConfig,
    bump_rad,
    is_moving,
    misread,
    slipped,
    with_dropouts,
    with_mixed_pixels,
    with_posts,
)
from chainslam.sim.lidar import RangeFinder
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.slam.geometry.poses import arc, compose
from chainslam.slam.robot import MotionCommand
from tests.sim.test_robot import room

CHANCE = Chance(3, 0)
DRIVES = [MotionCommand(0.1, 0.1), MotionCommand(0.15, -0.1), MotionCommand(0.0, 0.17)] * 3


def driven(faults, seed=5):
    """A robot's scans and odometry along some drives, and its true poses."""
    robot = SimulatedRobot(room(), seed, config=RobotConfig(faults=faults))
    scans, reports = [robot.sense()], []
    for command in DRIVES:
        reports.append(robot.drive(command))
        scans.append(robot.sense())
    return scans, reports, np.array(robot.record.poses_world), robot.record.faces_of_beams


def test_without_faults_nothing_changes():
    ranges = np.array([1.0, np.inf, 2.0])
    none = FaultsConfig()
    assert with_dropouts(ranges, none, CHANCE, 0) is ranges
    np.testing.assert_array_equal(with_mixed_pixels(ranges, none, True, CHANCE, 0)[0], ranges)
    slip = Slip(0.1, 0.2, 0.3)
    assert slipped(slip, none) is slip
    assert bump_rad(none, CHANCE, 0) == 0.0


def test_lost_beams_are_empty_and_hit_nothing_and_the_others_are_as_they_were():
    right, lost = driven(FaultsConfig()), driven(FaultsConfig(dropout=0.2))
    np.testing.assert_array_equal(right[2], lost[2])
    gone = np.array([np.isposinf(scan.ranges_m) for scan in lost[0]])
    assert 0.15 < gone.mean() < 0.25
    for k, (before, after) in enumerate(zip(right[0], lost[0], strict=True)):
        np.testing.assert_array_equal(before.ranges_m[~gone[k]], after.ranges_m[~gone[k]])
        assert np.all(lost[3][k][gone[k]] == -1)
        assert np.all(lost[3][k][~gone[k]] == right[3][k][~gone[k]])


def test_mixed_pixels_lie_between_the_two_surfaces_and_only_at_edges():
    ranges = np.array([1.0, 1.05, 3.0, 3.1, np.inf, 2.0, 1.0])
    config, drawn = FaultsConfig(mixed=0.5), []
    for step in range(200):
        found, mixed = with_mixed_pixels(ranges, config, False, CHANCE, step)
        assert not mixed[[0, 2, 3, 4, 6]].any()
        np.testing.assert_array_equal(found[~mixed], ranges[~mixed])
        assert np.all(found[mixed] <= np.maximum(ranges, np.roll(ranges, -1))[mixed])
        assert np.all(found[mixed] >= np.minimum(ranges, np.roll(ranges, -1))[mixed])
        drawn.append(mixed[[1, 5]])
    assert 0.4 < np.mean(drawn) < 0.6
    turned = np.array([1.0, 2.0, 2.0, 3.0])
    assert any(with_mixed_pixels(turned, config, True, CHANCE, step)[1][3] for step in range(20))
    assert not any(with_mixed_pixels(turned, config, False, CHANCE, step)[1][3] for step in range(20))


def test_a_bump_turns_the_robot_and_the_wheels_say_nothing_of_it():
    right, bumped = driven(FaultsConfig()), driven(FaultsConfig(bump=1.0, bump_rad=0.1))
    for before, after in zip(right[1], bumped[1], strict=True):
        np.testing.assert_array_equal(before.motion, after.motion)
        np.testing.assert_array_equal(before.cov, after.cov)
    off = np.diff(bumped[2][:, 2]) - np.diff(right[2][:, 2])
    np.testing.assert_allclose(np.abs(off), 0.1, atol=1e-12)
    sides = [bump_rad(FaultsConfig(bump=0.5, bump_rad=0.1), CHANCE, step) for step in range(400)]
    assert 0.4 < np.mean(np.abs(sides) > 0) < 0.6
    assert abs(np.mean(sides)) < 0.02


@pytest.mark.parametrize("times", [0.0, 3.0])
def test_wheels_slip_as_many_times_as_asked_and_state_the_same(times):
    assert slipped(Slip(1.0, -2.0, 4.0), FaultsConfig(slip=times)) == Slip(times, -2.0 * times, 4.0 * times)
    right, worse = driven(FaultsConfig()), driven(FaultsConfig(slip=times))
    for before, after in zip(right[1], worse[1], strict=True):
        np.testing.assert_array_equal(before.cov, after.cov)
    assert not np.array_equal(right[2], worse[2])


def test_a_scan_in_motion_is_taken_from_where_the_robot_was_at_each_beam():
    """Held against one ray for each beam from its own place, along the true arc; all else is as without."""
    exact = RobotConfig(faults=FaultsConfig(slip=0.0))
    robots = [
        SimulatedRobot(room(), 5, True, exact),
        SimulatedRobot(room(), 5, True, replace(exact, faults=FaultsConfig(slip=0.0, moving=1.0))),
    ]
    for command in (MotionCommand(0.15, 0.1), MotionCommand(0.0, 0.17), MotionCommand(-0.1, -0.05)):
        before = robots[0].true_pose
        for robot in robots:
            robot.drive(command)
        resting, moving = (robot.sense() for robot in robots)
        drive_s = seconds(command, exact.wheels, exact.wheel_speed_m_s)
        beams = len(moving.ranges_m)
        shares = np.clip(1.0 - exact.scan_s / drive_s * (1.0 - (np.arange(beams) + 0.5) / beams), 0.0, 1.0)
        finder = RangeFinder(room().faces, exact.lidar)
        poses = [compose(before, arc(share * command.forward_m, share * command.turn_rad)) for share in shares]
        true = np.array([finder.cast(pose)[0][beam] for beam, pose in enumerate(poses)])
        off = np.abs(moving.ranges_m - true)
        assert np.median(off[np.isfinite(off)]) < 1e-3
        assert np.mean(off[np.isfinite(off)] < 0.01) > 0.95
        assert np.median(np.abs(resting.ranges_m - moving.ranges_m)) > 5 * np.median(off)
        assert moving.start_s < moving.time_s


def test_as_many_scans_as_asked_are_in_motion_and_no_other_draw_is_shifted():
    right, moving = driven(FaultsConfig()), driven(FaultsConfig(moving=1.0))
    np.testing.assert_array_equal(right[2], moving[2])
    np.testing.assert_array_equal(right[0][0].ranges_m, moving[0][0].ranges_m)
    assert all(np.any(a.ranges_m != b.ranges_m) for a, b in zip(right[0][1:], moving[0][1:], strict=True))
    assert 0.4 < np.mean([is_moving(FaultsConfig(moving=0.5), CHANCE, step) for step in range(400)]) < 0.6


def test_beams_are_lost_in_runs_of_the_stated_length_and_share():
    config = FaultsConfig(dropout=0.05, clump=8)
    lost = np.array([np.isinf(with_dropouts(np.ones(720), config, CHANCE, step)) for step in range(200)])
    assert lost.mean() == pytest.approx(0.05, abs=0.01)
    ends = np.diff(np.concatenate([lost, lost[:, :1]], axis=1).astype(int), axis=1)
    assert lost.sum() / np.count_nonzero(ends == 1) >= 8.0


def test_a_misread_range_is_that_of_its_bias_scale_and_resolution():
    ranges = np.array([0.5, 2.0, 3.99, np.inf, np.nan])
    assert misread(ranges, FaultsConfig(), 4.0) is ranges
    told = misread(ranges, FaultsConfig(range_bias_m=0.03, range_scale=1.01), 4.0)
    np.testing.assert_allclose(told, [0.535, 2.05, np.inf, np.inf, np.nan])
    true = np.linspace(0.1, 3.9, 200)
    steps = misread(true, FaultsConfig(resolution_m=0.025), 4.0) / 0.025
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(steps - true / 0.025).max() <= 0.5 + 1e-9
    np.testing.assert_array_equal(misread(np.array([0.1, 0.2]), FaultsConfig(range_bias_m=-0.1), 4.0), [np.nan, 0.1])


def test_a_mirrored_scan_shows_left_on_the_right():
    right, mirrored = driven(FaultsConfig()), driven(FaultsConfig(mirrored=True))
    for plain, told in zip(right[0], mirrored[0], strict=True):
        back = np.argmin(np.abs(np.exp(1j * plain.bearings_rad)[:, None] - np.exp(-1j * plain.bearings_rad)), axis=1)
        np.testing.assert_array_equal(told.ranges_m, plain.ranges_m[back])


def test_a_late_scan_is_that_of_steps_ago_and_a_frozen_one_stays():
    right, late, frozen = (
        driven(faults) for faults in (FaultsConfig(), FaultsConfig(late=2), FaultsConfig(frozen_from=4))
    )
    for k in range(len(right[0])):
        np.testing.assert_array_equal(late[0][k].ranges_m, right[0][max(k - 2, 0)].ranges_m)
        np.testing.assert_array_equal(frozen[0][k].ranges_m, right[0][min(k, 3)].ranges_m)
        np.testing.assert_array_equal(frozen[3][k], right[3][min(k, 3)])
        assert late[0][k].time_s == right[0][k].time_s


def test_a_stuck_robot_stands_while_its_wheels_report():
    right, stuck = driven(FaultsConfig()), driven(FaultsConfig(stuck_from=3))
    for before, after in zip(right[1], stuck[1], strict=True):
        np.testing.assert_array_equal(before.motion, after.motion)
    np.testing.assert_array_equal(stuck[2][4:], np.broadcast_to(stuck[2][3], stuck[2][4:].shape))
    assert np.hypot(*(right[2][-1] - stuck[2][-1])[:2]) > 0.1


def test_posts_stand_evenly_around_the_scanner_at_their_distance():
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    seen = with_posts(np.full(360, 3.0), bearings, FaultsConfig(posts=4, post_rad=0.2))
    hidden = seen < 3.0
    np.testing.assert_array_equal(seen[hidden], 0.15)
    assert hidden.sum() == pytest.approx(360 * 4 * 0.2 / (2 * np.pi), abs=4)
    at = np.sort(np.angle(np.exp(4j * bearings[hidden])))
    assert np.abs(at).max() <= 0.4 + 1e-9
