"""Bags of a robot that drives through a room: late, uneven, in motion, with several topics, without odometry."""

from itertools import pairwise

import numpy as np
import pytest

from chainslam.experiments.replays.motion_of_scans import motion_of_scans
from chainslam.sim.logs.bag_topics import TopicsWanted
from chainslam.sim.logs.recorded_log import read_recorded_log
from chainslam.sim.logs.recorded_robot import RecordingError, recording_of
from chainslam.slam.geometry.poses import compose, inverse
from tests.sim.logs.written_bag import PLACE, Bag, pose_at, room_bag
from tests.slam.streaming_base import ranges_from

KINDS = ("ros1", "mcap", pytest.param("sqlite", marks=pytest.mark.long))


def true_motions(log, lag_s=0.0, place=PLACE):
    keyframes = np.flatnonzero(np.diff(log.keyframe_of_scan, prepend=-1))
    poses = [compose(pose_at(t - 1.0 + lag_s), place) for t in log.scan_time_s[keyframes]]
    return np.array([compose(inverse(a), b) for a, b in pairwise(poses)])


def off_by(log, **about):
    return np.abs(log.recording.odometry[1:] - true_motions(log, **about)).max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("late_s", [pytest.param(0.0, marks=pytest.mark.long), 0.5])
def test_a_scan_recorded_late_stands_where_it_was_taken(tmp_path, kind, late_s):
    log = read_recorded_log(room_bag(tmp_path / "a.bag", kind, late_s=late_s, count=lambda k: 60))
    assert len(log.scan_time_s) == 30
    assert len(log.recording) > 8
    assert off_by(log) < 2e-3
    assert log.notes == ()
    np.testing.assert_allclose(log.scanner_on_robot, PLACE, atol=1e-9)


@pytest.mark.parametrize("clockwise", [pytest.param(False, marks=pytest.mark.long), True])
def test_scans_in_motion_are_de_skewed(tmp_path, clockwise):
    log = read_recorded_log(room_bag(tmp_path / "a", beam_s=5e-4, clockwise=clockwise))
    np.testing.assert_allclose(np.diff(log.scan_time_s), 0.1, atol=1e-6)
    assert log.scan_time_s[0] == pytest.approx(1.0 + 179 * 5e-4)
    assert off_by(log) < 2e-3
    for k in (3, 8):
        scan, time_s = log.recording.scan(k), log.scan_time_s[np.flatnonzero(log.keyframe_of_scan == k)[0]]
        pose = compose(pose_at(time_s - 1.0), PLACE)
        true = ranges_from(np.tile(pose, (len(scan.bearings_rad), 1)), scan.bearings_rad)
        assert np.nanquantile(np.abs(scan.ranges_m - true), 0.95) < 0.01


def test_times_of_beams_that_cannot_be_are_left_aside(tmp_path):
    log = read_recorded_log(room_bag(tmp_path / "a", beam_s=0.05, count=lambda k: 20))
    np.testing.assert_allclose(log.scan_time_s[0], 1.0)


def test_each_scan_carries_its_own_beams(tmp_path):
    rng = np.random.default_rng(3)
    counts = rng.integers(178, 183, size=30)
    log = read_recorded_log(room_bag(tmp_path / "a", count=lambda k: int(counts[k])))
    assert not log.trouble
    assert len(log.scan_time_s) == 30
    for k, at in enumerate(np.flatnonzero(np.diff(log.keyframe_of_scan, prepend=-1))):
        scan = log.recording.scan(k)
        assert len(scan.bearings_rad) == counts[at]
        pose = compose(pose_at(log.scan_time_s[at] - 1.0), PLACE)
        true = ranges_from(np.tile(pose, (counts[at], 1)), scan.bearings_rad)
        np.testing.assert_allclose(scan.ranges_m, true, atol=1e-3)
    arrays = {name: getattr(log.recording, name) for name in log.recording.__dataclass_fields__}
    arrays = {name: value for name, value in arrays.items() if value is not None}
    assert len(recording_of(arrays).scan(3).bearings_rad) == len(log.recording.scan(3).bearings_rad)
    with pytest.raises(RecordingError, match="invalid ranges of bearings"):
        recording_of(arrays | {"fans": arrays["fans"] + np.array([10.0, 0.0, 0.0])})


def test_where_two_topics_can_be_read_the_bag_says_which_was_taken(tmp_path):
    path = room_bag(tmp_path / "a", depth=True)
    log = read_recorded_log(path)
    assert len(log.recording.bearings_rad) == 180
    assert log.notes == (
        "expected one topic of scans, found /scan and /depth: /scan is read; --scan-topic takes another",
    )
    other = read_recorded_log(path, wanted=TopicsWanted(scan="depth"))
    assert len(other.recording.bearings_rad) == 20
    assert other.notes == ()
    with pytest.raises(RecordingError, match=r"expected a topic /wheels of Odometry, found none: the bag has /depth"):
        read_recorded_log(path, wanted=TopicsWanted(odometry="/wheels"))


def test_two_topics_of_odometry_are_told(tmp_path):
    with Bag(tmp_path / "a", "mcap") as bag:
        for k in range(5):
            bag.odometry(1.0 + k, (0.2 * k, 0.0, 0.0), topic="/odom")
            bag.odometry(1.0 + k, (0.4 * k, 0.0, 0.0), topic="/a_filter")
            bag.scan(1.0 + k)
    (first, mounting) = read_recorded_log(tmp_path / "a").notes
    assert (
        first
        == "expected one topic of odometry, found /a_filter and /odom: /a_filter is read; --odom-topic takes another"
    )
    assert "expected a transform from base to laser, found none: the scanner is assumed to be at the middle" in mounting
    log = read_recorded_log(tmp_path / "a", wanted=TopicsWanted(odometry="/odom"))
    np.testing.assert_allclose(log.recording.odometry[1:, 0], 0.2)


@pytest.mark.parametrize("kind", KINDS)
def test_a_mounting_may_be_told_late(tmp_path, kind):
    log = read_recorded_log(room_bag(tmp_path / "a.bag", kind, mounting="late", count=lambda k: 60))
    np.testing.assert_allclose(log.scanner_on_robot, PLACE, atol=1e-9)
    assert log.notes == ()


def test_scans_after_the_end_of_the_odometry_are_told(tmp_path):
    with Bag(tmp_path / "a", "mcap") as bag:
        bag.transform(0.5, "base", "laser", PLACE)
        for k in range(8):
            if k < 4:
                bag.odometry(1.0 + k, (0.2 * k, 0.0, 0.0))
            bag.scan(1.0 + k)
    assert "found 3 scans after its end: its last pose is used" in read_recorded_log(tmp_path / "a").notes[0]


@pytest.mark.parametrize("kind", KINDS)
def test_scans_alone_tell_their_motion(tmp_path, kind):
    path = room_bag(tmp_path / "a.bag", kind, odometry=False, mounting="none", place=np.zeros(3), noise_m=0.01)
    log = read_recorded_log(path, motion_of=motion_of_scans)
    assert "found none: scan matching alone gives the motion" in log.notes[0]
    assert len(log.recording) > 8
    at = np.flatnonzero(np.diff(log.keyframe_of_scan, prepend=-1))[-1]
    found = np.zeros(3)
    for motion in log.recording.odometry[1:]:
        found = compose(found, motion)
    true = compose(inverse(pose_at(0.0)), pose_at(log.scan_time_s[at] - 1.0))
    assert np.hypot(*(found - true)[:2]) < 0.03
    assert abs(found[2] - true[2]) < np.deg2rad(1.0)


def test_a_scanner_inside_something_is_told_and_its_scans_are_left_out(tmp_path):
    with Bag(tmp_path / "a", "mcap") as bag:
        bag.transform(0.5, "base", "laser", PLACE)
        for k in range(8):
            bag.odometry(1.0 + k, (0.2 * k, 0.0, 0.0))
            beside = np.where(np.arange(90) < 45, 0.05, 2.0)
            inside = np.where(np.arange(90) % 3, 0.05, 0.3)
            bag.scan(1.0 + k, inside if k in (3, 4) else beside, -np.pi, 2.0 * np.pi / 90)
    log = read_recorded_log(tmp_path / "a")
    assert len(log.scan_time_s) == 6
    assert "found it inside an object in 2 scans, 4.000 s to 5.000 s" in log.notes[0]
