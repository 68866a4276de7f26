"""ROS bags of all kinds become the same recording; each bag is written here."""

import builtins
from itertools import pairwise

import numpy as np
import pytest

from chainslam.sim.logs import rosbag
from chainslam.sim.logs.recorded_log import read_recorded_log
from chainslam.sim.logs.recorded_robot import RecordingError
from chainslam.slam.geometry.poses import compose, inverse
from tests.sim.logs.written_bag import Bag

KINDS = ("ros1", "sqlite", "mcap")
OFFSET = (0.2, 0.1, 0.5)


def pose_at(time_s):
    return np.array([0.4 * (time_s - 10.0), 0.0, 0.3 * (time_s - 10.0)])


def recorded(path, kind, by="topic", over=False, mounted=True, **scans):
    """Six scans half a second apart, the odometry between them."""
    with Bag(path, kind) as bag:
        if mounted:
            bag.transform(9.0, "base", "plate", (0.2, 0.0, 0.0), topic="/tf_static")
            bag.transform(9.0, "plate", "laser", (0.0, 0.1, 0.5), over, topic="/tf_static")
        for k in range(6):
            time_s = 10.0 + 0.5 * k
            bag.scan(time_s, **scans)
            for when in (time_s - 0.2, time_s + 0.1):
                if by == "topic":
                    bag.odometry(when, pose_at(when))
                else:
                    bag.transform(when, "odom", "base", pose_at(when))
    return path


def named(folder, kind, name="a"):
    """The path of a bag: a file for ROS 1, a folder for ROS 2."""
    return folder / (f"{name}.bag" if kind == "ros1" else name)


def test_a_ros_2_bag_may_have_the_name_of_a_ros_1_file(tmp_path):
    folder = recorded(tmp_path / "a", "mcap")
    plain = read_recorded_log(folder)
    renamed = folder.rename(tmp_path / "a.bag")
    for path in (renamed, next(renamed.glob("*.mcap"))):
        np.testing.assert_array_equal(read_recorded_log(path).recording.odometry, plain.recording.odometry)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("by", ["topic", "tf"])
def test_every_kind_of_bag_tells_scans_odometry_and_where_the_scanner_sits(tmp_path, kind, by):
    log = read_recorded_log(recorded(named(tmp_path, kind), kind, by))
    assert not log.trouble
    np.testing.assert_allclose(log.scan_time_s, 10.0 + 0.5 * np.arange(6))
    np.testing.assert_allclose(log.recording.bearings_rad, [-0.4, -0.2, 0.0, 0.2, 0.4], atol=1e-6)
    assert log.recording.range_max_m == 8.0
    np.testing.assert_allclose(log.scanner_on_robot, OFFSET, atol=1e-9)
    scanner = [compose(pose_at(time_s), np.array(OFFSET)) for time_s in log.scan_time_s]
    expected = [compose(inverse(a), b) for a, b in pairwise(scanner)]
    np.testing.assert_allclose(log.recording.odometry[1:], expected, atol=2e-3)


def test_the_file_within_a_ros_2_bag_may_be_named(tmp_path):
    folder = recorded(tmp_path / "a", "mcap")
    log = read_recorded_log(next(folder.glob("*.mcap")))
    np.testing.assert_array_equal(log.recording.odometry, read_recorded_log(folder).recording.odometry)


def test_a_scanner_upside_down_sees_its_beams_from_the_other_side(tmp_path):
    ranges = (1.0, 2.0, 3.0, 4.0, 5.0)
    log = read_recorded_log(recorded(tmp_path / "a.bag", "ros1", over=True, ranges=ranges, low=-0.3))
    np.testing.assert_allclose(log.recording.bearings_rad, [-0.5, -0.3, -0.1, 0.1, 0.3], atol=1e-6)
    np.testing.assert_allclose(log.recording.ranges_m[0], ranges[::-1])
    np.testing.assert_allclose(log.scanner_on_robot, OFFSET, atol=1e-9)


def test_ranges_are_as_rep_117_has_them(tmp_path):
    ranges = (0.05, np.inf, 8.5, np.nan, 2.0, -np.inf)
    found = read_recorded_log(recorded(tmp_path / "a.bag", "ros1", ranges=ranges)).recording.ranges_m[0]
    np.testing.assert_array_equal(found, [np.nan, np.inf, np.inf, np.nan, 2.0, np.nan])


def test_beams_that_run_the_other_way_are_turned_round_and_no_beam_of_a_turn_comes_twice(tmp_path):
    log = read_recorded_log(recorded(tmp_path / "a.bag", "ros1", ranges=(1.0, 2.0, 3.0), low=0.2, step=-0.2))
    np.testing.assert_allclose(log.recording.bearings_rad, [-0.2, 0.0, 0.2], atol=1e-6)
    np.testing.assert_allclose(log.recording.ranges_m[0], [3.0, 2.0, 1.0])
    turn = read_recorded_log(recorded(tmp_path / "b.bag", "ros1", ranges=(1.0,) * 361, low=0.0, step=np.deg2rad(1.0)))
    assert len(turn.recording.bearings_rad) == 360


def test_without_a_mounting_the_scanner_sits_in_the_middle(tmp_path):
    assert not read_recorded_log(recorded(tmp_path / "a", "sqlite", mounted=False)).scanner_on_robot.any()


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_scans_lists_the_topics_that_there_are(tmp_path, kind):
    with Bag(named(tmp_path, kind), kind) as bag:
        bag.odometry(1.0, (0, 0, 0), topic="/wheels")
    with pytest.raises(RecordingError, match=r"expected a topic of LaserScan.* the bag has /wheels \(nav_msgs"):
        read_recorded_log(named(tmp_path, kind))


@pytest.mark.parametrize("with_tf", [False, True])
def test_scans_without_odometry_are_no_recording_unless_somebody_tells_their_motion(tmp_path, with_tf):
    with Bag(tmp_path / "a.bag", "ros1") as bag:
        bag.scan(1.0)
        if with_tf:
            bag.transform(1.0, "base", "laser", (0, 0, 0))
    with pytest.raises(RecordingError, match="expected odometry, found none"):
        read_recorded_log(tmp_path / "a.bag")
    notes = []
    assert len(list(rosbag.read_bag(tmp_path / "a.bag", notes=notes))) == 1
    assert "scan matching alone gives the motion" in notes[0]


@pytest.mark.parametrize("seed", range(3))
def test_the_motion_of_a_scanner_is_that_of_the_robot_seen_from_where_it_sits(seed):
    motion, place = np.random.default_rng(seed).normal(size=(2, 3))
    by_scanner = compose(place, rosbag._at_scanner(motion, place).motion)
    np.testing.assert_allclose(by_scanner, compose(motion, place), atol=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_bag_is_told_in_one_line(tmp_path, kind, share):
    path = recorded(named(tmp_path, kind), kind)
    file = path if path.is_file() else next(each for each in path.iterdir() if each.suffix != ".yaml")
    content = file.read_bytes()
    file.write_bytes(content[: int(len(content) * share)])
    told = said_of(path)
    assert "\n" not in told
    assert "found a" in told or told == "6 scans"


def said_of(path):
    try:
        return f"{len(read_recorded_log(path).scan_time_s)} scans"
    except RecordingError as error:
        return str(error)


WRONG_SCANS = {
    "no step": ({"step": 0.0}, "expected beams, found 5 of them 0 rad apart"),
    "endless step": ({"step": np.inf}, "expected beams, found 5 of them inf rad apart"),
    "begins nowhere": ({"low": np.nan}, "expected beams, found 5 of them"),
    "no range": ({"most": 0.0}, "expected the scanner's maximum range, found 0 m"),
    "endless range": ({"most": np.inf}, "expected the scanner's maximum range, found inf m"),
}


@pytest.mark.parametrize("case", WRONG_SCANS)
def test_a_scan_that_is_none_is_told_with_its_time(tmp_path, case):
    changes, words = WRONG_SCANS[case]
    told = said_of(recorded(tmp_path / "a.bag", "ros1", **changes))
    assert f"scan at 10.000000 s: {words}" in told


def test_a_pose_that_is_nowhere_is_told(tmp_path):
    with Bag(tmp_path / "a.bag", "ros1") as bag:
        bag.odometry(1.0, (np.nan, 0.0, 0.0))
        bag.scan(1.0)
    assert "expected a finite pose, found NaN" in said_of(tmp_path / "a.bag")


def test_a_bag_that_cannot_be_opened_is_no_damaged_one(tmp_path, monkeypatch):
    path = recorded(tmp_path / "a.bag", "ros1")

    def refused(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(rosbag, "_scans", refused)
    assert said_of(path) == "expected a recorded log, found a.bag (Permission denied): name a log that exists"


def test_scans_that_tell_no_beams_are_left_out(tmp_path):
    with Bag(tmp_path / "a.bag", "ros1") as bag:
        for k in range(4):
            bag.scan(10.0 + k, ranges=(1.0,) * (5 if k < 2 else 1))
            bag.odometry(10.0 + k, pose_at(10.0 + k))
    log = read_recorded_log(tmp_path / "a.bag")
    assert len(log.scan_time_s) == 2
    assert log.left_out.words(2).startswith("2 of 4 scans are left out: scan at 12.000000 s: expected beams, found 1")


def test_without_rosbags_one_line_tells_what_to_install(tmp_path, monkeypatch):
    path = recorded(tmp_path / "a.bag", "ros1")
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("rosbags"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RecordingError, match=r"pip install 'chainslam\[ros\]'"):
        read_recorded_log(path)


def test_a_folder_that_is_no_bag_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="a folder"):
        read_recorded_log(tmp_path)
