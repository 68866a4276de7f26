"""What makes the arrays of a log a recording: each fault is told by itself."""

import numpy as np
import pytest

from chainslam.sim.logs.recorded_robot import (
    MOST_M,
    RecordedRobot,
    RecordingError,
    are_covariances,
    knows_truth,
    read_log,
    recording_of,
)
from chainslam.slam.robot import MotionCommand

STEPS, BEAMS = 3, 5


def arrays_of(**changes):
    """A log of three scans of five beams."""
    arrays = {
        "format": np.int64(1),
        "time_s": np.arange(float(STEPS)),
        "bearings_rad": np.linspace(-1.0, 1.0, BEAMS),
        "ranges_m": np.array([[1.0, 2.0, np.inf, np.nan, 4.0]] * STEPS),
        "sigma_m": np.full(BEAMS, 0.01),
        "sigma_share": np.float64(0.01),
        "range_max_m": np.float64(4.0),
        "odometry": np.zeros((STEPS, 3)),
        "odometry_cov": np.zeros((STEPS, 3, 3)),
    }
    return {name: np.asarray(value) for name, value in (arrays | changes).items()}


def with_one(name, value):
    """The same log with another last number of an array."""
    array = np.array(arrays_of()[name], dtype=float)
    array.flat[-1] = value
    return {name: array}


def test_a_good_log_is_a_recording_and_is_played_to_its_end():
    robot = RecordedRobot(recording_of(arrays_of(touched=np.array([False, True, False]))))
    assert [robot.drive(MotionCommand(0.0, 0.0)).touched for _ in range(2)] == [True, False]
    assert robot.sense().time_s == 2.0
    with pytest.raises(EOFError, match="at most 3 scans"):
        robot.drive(MotionCommand(0.0, 0.0))


def test_a_recording_tells_where_the_robot_was_carried():
    robot = RecordedRobot(recording_of(arrays_of(carried=np.array([False, False, True]))))
    assert [robot.drive(MotionCommand(0.0, 0.0)).carried for _ in range(2)] == [False, True]
    assert not RecordedRobot(recording_of(arrays_of())).drive(MotionCommand(0.0, 0.0)).carried


NAMES = ("time_s", "bearings_rad", "sigma_m", "sigma_share", "range_max_m", "odometry", "odometry_cov")
FAULTS = {
    "no scan": (
        {name: arrays_of()[name][:0] for name in ("time_s", "ranges_m", "odometry", "odometry_cov")},
        "0 scans of 5 beams",
    ),
    "one beam": (
        {name: arrays_of()[name][..., :1] for name in ("bearings_rad", "ranges_m", "sigma_m")},
        "3 scans of 1 beams",
    ),
    **{f"{name} NaN": (with_one(name, np.nan), f"{name} with NaN or beyond") for name in NAMES},
    **{f"{name} far": (with_one(name, -1.01 * MOST_M), f"{name} with NaN or beyond") for name in NAMES},
    "sigma 0": (with_one("sigma_m", 0.0), "sigma_m 0, sigma_share 0.01, range_max_m 4"),
    "range 0": (with_one("range_max_m", 0.0), "sigma_m 0.01, sigma_share 0.01, range_max_m 0"),
    "share below 0": (with_one("sigma_share", -0.01), "sigma_share -0.01"),
    "back in time": (with_one("time_s", 0.5), "times that decrease"),
    "late": ({"scan_start_s": np.array([0.0, 1.1, 2.0])}, "scans that end before they begin"),
    "uneven": (with_one("bearings_rad", 1.2), "bearings that are not evenly spaced"),
    "backwards": ({"bearings_rad": np.linspace(1.0, -1.0, BEAMS)}, "bearings that are not evenly spaced"),
    "two turns": ({"bearings_rad": np.linspace(-7.0, 7.0, BEAMS)}, "bearings that are not evenly spaced"),
    "nothing far": (with_one("ranges_m", 0.0), "ranges of 0 m or less or beyond 4 m"),
    "too far": (with_one("ranges_m", 4.01), "ranges of 0 m or less or beyond 4 m"),
    "skew": ({"odometry_cov": np.triu(np.ones((STEPS, 3, 3)))}, "odometry_cov that is not a covariance"),
    "negative": (with_one("odometry_cov", -1.0), "odometry_cov that is not a covariance"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_each_fault_of_a_recording_is_told(case):
    changes, words = FAULTS[case]
    with pytest.raises(RecordingError, match=r"^expected the log of a robot, found ") as caught:
        recording_of(arrays_of(**changes))
    assert words in str(caught.value)


def test_what_rounding_leaves_of_a_covariance_is_one_still():
    assert are_covariances(np.array([[1.0, 1e-10], [0.0, -1e-12]]))
    assert not are_covariances(np.array([[1.0, 2e-6], [0.0, 1.0]]))
    assert not are_covariances(np.diag([1.0, -1e-6]))


@pytest.mark.parametrize("said", [0, 2])
def test_a_log_of_another_format_is_refused(tmp_path, said):
    np.savez(tmp_path / "log.npz", **arrays_of(format=np.int64(said)))
    with pytest.raises(RecordingError, match=f"format {said} of another version, where this one reads 1"):
        read_log(tmp_path / "log.npz")


def test_places_without_a_log_are_told_and_are_left_to_the_reader_of_own_logs(tmp_path):
    (tmp_path / "text.npz").write_text("hello")
    for name, words in (("none.npz", "no file"), ("text.npz", "archive of arrays"), ("", "a folder")):
        with pytest.raises(RecordingError, match=r"^expected a run's log\.npz, found ") as caught:
            read_log(tmp_path / name)
        assert words in str(caught.value)
        assert knows_truth(tmp_path / name)
    np.savez(tmp_path / "log.npz", **arrays_of())
    assert not knows_truth(tmp_path / "log.npz")
