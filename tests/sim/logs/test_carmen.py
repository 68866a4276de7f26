"""CARMEN logs become recordings: whatever is wrong with a log, what was good before it is kept."""

import gzip

import numpy as np
import pytest

from chainslam.sim.logs import keyframes
from chainslam.sim.logs.keyframes import KeyframesConfig
from chainslam.sim.logs.recorded_log import is_own_log, read_recorded_log
from chainslam.sim.logs.recorded_robot import RecordingError, recording_of
from chainslam.slam.geometry.poses import compose, inverse, wrap


def flaser(x, y=0.0, theta=0.0, time_s=None, ranges=(), beams=180, laser=None):
    values = [*ranges, *[2.5] * (beams - len(ranges))]
    laser = (x, y, theta) if laser is None else laser
    time_s = 100.0 + x if time_s is None else time_s
    return " ".join(map(str, ["FLASER", beams, *values, *laser, x, y, theta, time_s, "robot", time_s]))


def robotlaser(x, beams=4, offset=(0.0, 0.0, 0.0), most=8.0, ranges=None, step=0.2):
    robot = np.array([x, 0.0, 0.0])
    laser = compose(robot, np.array(offset))
    head = ["ROBOTLASER1", 0, -0.3, 0.6, step, most, 0.01, 0, beams, *(ranges or [1.0] * beams), 2, 7, 7]
    return " ".join(map(str, [*head, *laser, *robot, 0, 0, 0, 0, 0, 100.0 + x, "robot", 0.0]))


def written(path, lines):
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def read(tmp_path, lines, **config):
    return read_recorded_log(written(tmp_path / "a.log", lines), KeyframesConfig(**config))


@pytest.mark.parametrize(
    ("beams", "step", "last"), [(180, 1.0, 89.0), (181, 1.0, 90), (360, 0.5, 89.5), (361, 0.5, 90)]
)
def test_beams_begin_to_the_right_and_cover_180_degrees(tmp_path, beams, step, last):
    found = np.rad2deg(read(tmp_path, [flaser(0.0, beams=beams)]).recording.bearings_rad)
    assert len(found) == beams
    np.testing.assert_allclose([found[0], found[1] - found[0], found[-1]], [-90.0, step, last])


def test_no_return_is_infinite_and_a_range_of_nothing_is_unknown(tmp_path):
    recording = read(tmp_path, [flaser(0.0, ranges=(1.5, 81.91, 50.0, 0.0, -1.0, 39.0))]).recording
    np.testing.assert_array_equal(recording.ranges_m[0, :6], [1.5, np.inf, np.inf, np.nan, np.nan, 39.0])
    assert recording.range_max_m == 40.0


def test_codes_of_a_scanner_in_its_mode_of_8_m_are_no_returns(tmp_path):
    near = read(tmp_path, [flaser(0.0, ranges=(1.5, 8.183, 8.191, 8.18))]).recording
    np.testing.assert_array_equal(near.ranges_m[0, :4], [1.5, np.nan, np.nan, 8.18])
    far = read(tmp_path, [flaser(0.0, ranges=(1.5, 8.183, 8.19, 8.2))]).recording
    np.testing.assert_array_equal(far.ranges_m[0, :4], [1.5, 8.183, 8.19, 8.2])


def test_a_scan_is_mapped_where_the_wheels_have_moved_far_enough_or_turned(tmp_path):
    lines = ["# a comment", "PARAM robot_length 1", "ODOM 0 0 0 0 0 0 99 robot 0"]
    lines += [flaser(x) for x in (0.0, 0.06, 0.11, 0.15)] + [flaser(0.16, theta=0.1), flaser(0.4, theta=0.1)]
    log = read(tmp_path, lines)
    np.testing.assert_allclose(log.recording.time_s, [0.0, 0.11, 0.16, 0.4])
    np.testing.assert_array_equal(log.keyframe_of_scan, [0, 0, 1, 1, 2, 3])
    np.testing.assert_allclose(log.scan_time_s, 100.0 + np.array([0.0, 0.06, 0.11, 0.15, 0.16, 0.4]))
    halved = read(tmp_path, lines, every=2).recording
    np.testing.assert_allclose(halved.time_s, [0.0, 0.16])


def test_the_scans_between_keyframes_are_where_the_wheels_say(tmp_path):
    rng = np.random.default_rng(1)
    poses = np.cumsum(rng.normal(0.03, 0.03, (40, 3)), axis=0)
    log = read(tmp_path, [flaser(*pose, time_s=k) for k, pose in enumerate(poses)])
    assert 1 < len(log.recording) < 40
    start, keyframes = poses[0], [poses[0]]
    for motion in log.recording.odometry[1:]:
        keyframes.append(compose(keyframes[-1], motion))
    found = log.poses_of_scans(np.array(keyframes))
    np.testing.assert_allclose(found[:, :2], poses[:, :2], atol=1e-9)
    np.testing.assert_allclose(wrap(found[:, 2] - poses[:, 2]), 0.0, atol=1e-9)
    assert len(log.poses_of_scans(start[None])) == np.count_nonzero(log.keyframe_of_scan == 0)


def test_what_the_wheels_were_wrong_by_between_two_known_keyframes_is_spread_along_their_way(tmp_path):
    """The wheels report a tenth too little and turn too far, evenly: all scans between keyframes come out right."""
    true = np.column_stack([0.04 * np.arange(60), np.zeros(60), np.zeros(60)])
    wheels = np.column_stack([0.9 * true[:, 0], np.zeros(60), 0.01 * np.arange(60)])
    log = read(tmp_path, [flaser(*pose, time_s=k) for k, pose in enumerate(wheels)])
    of_keyframe = np.searchsorted(log.keyframe_of_scan, np.arange(len(log.recording)))
    assert 4 < len(of_keyframe) < 30
    found, behind = log.smoothed_poses_of_scans(true[of_keyframe]), log.poses_of_scans(true[of_keyframe])
    last = of_keyframe[-1]
    np.testing.assert_allclose(found[:last], true[:last], atol=2e-3)
    assert np.abs(behind[:last] - true[:last])[:, 2].max() > 0.01
    np.testing.assert_array_equal(found[last:], behind[last:])
    np.testing.assert_array_equal(found[of_keyframe], true[of_keyframe])
    assert len(log.smoothed_poses_of_scans(true[:1])) == np.count_nonzero(log.keyframe_of_scan == 0)


def test_what_is_mapped_is_a_recording_that_a_log_of_our_own_may_hold(tmp_path):
    r = read(tmp_path, [flaser(0.2 * k, theta=0.3 * k) for k in range(5)]).recording
    arrays = {name: getattr(r, name) for name in ("time_s", "bearings_rad", "ranges_m", "sigma_m", "odometry")}
    again = recording_of(arrays | {"range_max_m": np.array(r.range_max_m), "odometry_cov": r.odometry_cov})
    assert len(again) == 5
    assert np.all(np.linalg.eigvalsh(r.odometry_cov[1:]) > 0)
    assert not r.odometry_cov[0].any()


@pytest.mark.parametrize("offset", [(0.2, 0.0, 0.0), (0.1, -0.3, 0.5)])
def test_the_motions_are_those_of_the_scanner_on_the_robot(tmp_path, offset):
    turned = np.array([0.0, 0.0, 0.5])
    lines = [flaser(*p, time_s=k, laser=compose(p, np.array(offset))) for k, p in enumerate([np.zeros(3), turned])]
    log = read(tmp_path, lines)
    np.testing.assert_allclose(log.scanner_on_robot, offset, atol=1e-9)
    expected = compose(inverse(np.array(offset)), compose(turned, np.array(offset)))
    np.testing.assert_allclose(log.recording.odometry[1], expected, atol=1e-9)


def test_a_corrected_path_beside_the_wheels_is_no_place_of_the_scanner(tmp_path):
    lines = [flaser(0.2 * k, laser=(0.1 + 0.2 * k, 0.02 * k, 0.01 * k)) for k in range(6)]
    log = read(tmp_path, lines)
    assert not log.scanner_on_robot.any()
    np.testing.assert_allclose(log.recording.odometry[1:, 1], 0.0, atol=1e-12)


@pytest.mark.parametrize(("ahead_m", "found_m"), [(1.9, 1.9), (2.1, 0.0)])
def test_no_scanner_sits_farther_than_two_metres_from_the_middle_of_its_robot(tmp_path, ahead_m, found_m):
    log = read(tmp_path, [flaser(0.2 * k, laser=(ahead_m + 0.2 * k, 0.0, 0.0)) for k in range(6)])
    np.testing.assert_allclose(log.scanner_on_robot, [found_m, 0.0, 0.0], atol=1e-9)


def test_robotlaser_tells_its_beams_its_range_and_where_it_sits(tmp_path):
    lines = [
        robotlaser(0.0, offset=(0.3, 0.0, 0.0), ranges=[1.0, 8.0, 9.0, 2.0]),
        robotlaser(0.5, offset=(0.3, 0.0, 0.0)),
    ]
    log = read(tmp_path, lines)
    recording = log.recording
    np.testing.assert_allclose(recording.bearings_rad, [-0.3, -0.1, 0.1, 0.3])
    np.testing.assert_array_equal(recording.ranges_m[0], [1.0, np.inf, np.inf, 2.0])
    assert recording.range_max_m == 8.0
    np.testing.assert_allclose(log.scanner_on_robot, [0.3, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(log.scan_time_s, [100.0, 100.5])


def test_dpslam_logs_have_no_times_and_the_pose_before_each_scan(tmp_path):
    lines = []
    for k in range(3):
        lines += [f"Odometry {0.2 * k} 0 0", "Laser 181 " + " ".join(["3.0"] * 181)]
    log = read(tmp_path, lines)
    np.testing.assert_allclose(log.scan_time_s, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(log.recording.odometry[1:], [[0.2, 0, 0]] * 2, atol=1e-12)
    assert read(tmp_path, [*lines, "Laser 180 1"]).trouble.startswith("line 7: ")
    assert read(tmp_path, [*lines, "Odometry 1 x 0", lines[-1]]).trouble.startswith("line 8: line 7: ")


def test_gzip_reads_as_plain_text_does(tmp_path):
    lines = [flaser(0.2 * k) for k in range(4)]
    plain = read(tmp_path, lines)
    packed = tmp_path / "b.log.gz"
    packed.write_bytes(gzip.compress((tmp_path / "a.log").read_bytes()))
    np.testing.assert_array_equal(read_recorded_log(packed).recording.ranges_m, plain.recording.ranges_m)


def test_of_a_gzip_file_that_was_cut_short_the_whole_lines_are_kept(tmp_path):
    rng = np.random.default_rng(0)
    text = "".join(flaser(0.2 * k, ranges=rng.uniform(1, 9, 180)) + "\n" for k in range(50))
    packed = tmp_path / "b.log.gz"
    content = gzip.compress(text.encode())
    packed.write_bytes(content[: len(content) // 2])
    log = read_recorded_log(packed)
    assert 5 < len(log.recording) < 45
    assert log.trouble.startswith(f"after line {len(log.scan_time_s)}: ")
    packed.write_bytes(content[:40])
    with pytest.raises(RecordingError, match="cut short"):
        read_recorded_log(packed)


@pytest.mark.parametrize("place", [30, -6], ids=["in the middle", "in the sum at its end"])
def test_a_gzip_file_with_other_bytes_is_told(tmp_path, place):
    rng = np.random.default_rng(0)
    content = bytearray(
        gzip.compress("".join(flaser(0.2 * k, ranges=rng.uniform(1, 9, 180)) + "\n" for k in range(9)).encode())
    )
    content[place] ^= 0xFF
    packed = tmp_path / "b.log.gz"
    packed.write_bytes(content)
    try:
        told = read_recorded_log(packed).trouble
    except RecordingError as error:
        told = str(error)
    assert "found it cut short" in told


WRONG = [
    (flaser(9.0, time_s=1.0), "expected time to go on from 100.200000 s, found 1.000000 s"),
    ("FLASER 180 1.0 2.0", "expected 180 ranges, found 2"),
    (flaser(9.0).rsplit(" ", 3)[0], "expected 7 numbers in FLASER, found 6"),
    (flaser(9.0, ranges=("x",)), "expected 180 ranges, found other words"),
    (flaser("x", time_s=200.0), "expected 7 numbers in FLASER, found other words"),
    (flaser(float("nan"), time_s=200.0), "expected finite numbers in FLASER"),
    (flaser(1e7), "expected a pose in metres"),
    ("FLASER", "expected a number of beams, found nothing"),
    ("FLASER -3", "expected a number of beams, found -3"),
    ("Laser 181 1", "expected an Odometry line before"),
    ("ROBOTLASER1 0 0", "expected 7 numbers in ROBOTLASER1, found 2"),
    ("ROBOTLASER1 0 0 1 1 8 0 0", "expected a number of beams, found nothing"),
    (robotlaser(9.0).rsplit(" ", 3)[0], "expected 12 numbers in ROBOTLASER1, found 11"),
    (robotlaser(9.0, most=0.0), "expected beams over one turn"),
    (robotlaser(9.0, step=0.0), "expected beams over one turn"),
    (robotlaser(9.0, beams=8, step=1.0), "expected beams over one turn"),
    ("ROBOTLASER1 0 0 1 1 8 0 0 1", "expected a number of beams, found 1"),
    (f"ROBOTLASER1 0 0 1 1 8 0 0 {10**8}", "expected a number of beams, found 100000000"),
]


@pytest.mark.parametrize(("line", "found"), WRONG)
def test_a_scan_that_cannot_be_read_is_left_out_and_told_with_its_line(tmp_path, line, found):
    scans = [[robotlaser(x)] if line.startswith("ROBOT") else [flaser(x)] for x in (0.0, 0.2, 0.4)]
    if line.startswith("Laser"):
        scans = [[f"Odometry {x} 0 0", "Laser 181 " + " ".join(["3.0"] * 181)] for x in (0.0, 0.2, 0.4)]
    at = 1 if line.startswith("Laser") else 3
    before = [] if at == 1 else [*scans[0], *scans[1]]
    after = [*scans[0], *scans[1], *scans[2]] if at == 1 else scans[2]
    log = read(tmp_path, [*before, line, *after])
    assert (log.trouble, log.left_out.count, len(log.recording)) == ("", 1, 3)
    assert log.left_out.first.startswith(f"line {at}: "), log.left_out.first
    assert found in log.left_out.first
    assert "\n" not in log.left_out.words(3)


def test_a_log_of_more_than_can_be_kept_ends_there(tmp_path, monkeypatch):
    monkeypatch.setattr(keyframes, "LIMIT_BYTES", 3 * 180 * 8)
    log = read(tmp_path, [flaser(0.2 * k) for k in range(20)])
    assert len(log.recording) < 20
    assert "MiB at most, found more" in log.trouble


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"", "expected lines FLASER"),
        (b"\x00\xff" * 5000, "expected lines FLASER"),
        (b"ODOM 0 0 0 0 0 0 1 robot 1\n", "expected scans, found none"),
        (b"FLASER 90 1\n", "line 1: expected 90 ranges"),
        (b"x" * (2**20 + 5), "line 1: expected a line of text"),
    ],
)
def test_a_log_without_one_scan_is_refused_in_one_line(tmp_path, content, found):
    path = tmp_path / "a.log"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"expected a recorded log, found a\.log") as caught:
        read_recorded_log(path)
    assert found in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="a folder"):
        read_recorded_log(tmp_path)
    with pytest.raises(RecordingError, match="No such file"):
        read_recorded_log(tmp_path / "none.log")


def test_own_logs_are_told_by_their_contents(tmp_path):
    np.savez(tmp_path / "log", a=1)
    (tmp_path / "log.npz").rename(tmp_path / "other")
    assert is_own_log(tmp_path / "other")
    assert is_own_log(tmp_path / "missing.npz")
    assert not is_own_log(written(tmp_path / "a.log", [flaser(0.0)]))
