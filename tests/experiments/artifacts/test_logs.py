"""A log that somebody has changed: one line and status 2, and nothing is unpickled or computed."""

import os
import zipfile

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert main(["explore", "paper-fig4", "--max-steps", "4", "--out", str(folder)]) == 0
    return folder


def with_nan(values):
    changed = np.array(values, dtype=float)
    changed.flat[1] = np.nan
    return changed


CHANGES = {
    "a scalar time": lambda log: {"time_s": np.float64(1.0)},
    "times as words": lambda log: {"time_s": np.array([str(t) for t in log["time_s"]])},
    "scans that end before they begin": lambda log: {"scan_start_s": log["time_s"] + 1.0},
    "times backwards": lambda log: {"time_s": log["time_s"][::-1]},
    "an object": lambda log: {"odometry": np.array([[None] * 3] * 4)},
    "bearings all zero": lambda log: {"bearings_rad": 0 * log["bearings_rad"]},
    "bearings backwards": lambda log: {"bearings_rad": log["bearings_rad"][::-1]},
    "bearings of three turns": lambda log: {"bearings_rad": 3 * log["bearings_rad"]},
    "one beam": lambda log: {n: log[n][..., :1] for n in ("bearings_rad", "ranges_m", "true_face_of_beam")},
    "no scan": lambda log: {n: log[n][:0] for n in log if log[n].shape[:1] == (4,)},
    "another number of scans": lambda log: {"ranges_m": log["ranges_m"][:3]},
    "ranges turned round": lambda log: {"ranges_m": log["ranges_m"].T},
    "ranges below 0": lambda log: {"ranges_m": -log["ranges_m"]},
    "ranges beyond the scanner's": lambda log: {"ranges_m": 1e6 * log["ranges_m"]},
    "sigma 0": lambda log: {"sigma_m": 0 * log["sigma_m"]},
    "one sigma for all": lambda log: {"sigma_m": np.float64(0.01)},
    "a sigma that shrinks with the range": lambda log: {"sigma_share": np.float64(-0.01)},
    "sigma of many": lambda log: {"sigma_m": np.ones(4)},
    "range NaN": lambda log: {"range_max_m": np.float64(np.nan)},
    "odometry NaN": lambda log: {"odometry": with_nan(log["odometry"])},
    "odometry beyond all": lambda log: {"odometry": 1e300 + log["odometry"]},
    "a covariance NaN": lambda log: {"odometry_cov": with_nan(log["odometry_cov"])},
    "a negative covariance": lambda log: {"odometry_cov": -log["odometry_cov"]},
    "a skew covariance": lambda log: {"odometry_cov": log["odometry_cov"] + np.triu(np.ones((3, 3)), 1)},
    "a start without a covariance": lambda log: {"start_cov": -log["start_cov"]},
    "a start NaN": lambda log: {"start_pose": with_nan(log["start_pose"])},
    "true poses NaN": lambda log: {"true_poses": with_nan(log["true_poses"])},
    "faces that are not there": lambda log: {"true_face_of_beam": log["true_face_of_beam"] + 10**6},
    "faces below none": lambda log: {"true_face_of_beam": log["true_face_of_beam"] - 10},
    "no truth": lambda log: {"true_poses": None},
    "no times": lambda log: {"time_s": None},
    "no format": lambda log: {"format": None},
    "another format": lambda log: {"format": np.int64(99)},
    "a format in words": lambda log: {"format": np.array("1")},
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_changed_log_gets_one_line_and_status_2(run, tmp_path, capsys, change):
    with np.load(run / "log.npz") as archive:
        log = dict(archive)
    log = {name: value for name, value in (log | CHANGES[change](log)).items() if value is not None}
    (tmp_path / "config.json").write_bytes((run / "config.json").read_bytes())
    np.savez(tmp_path / "log.npz", **log)
    told(capsys, ["replay", str(tmp_path / "log.npz")], tmp_path)
    if not change.startswith(("a start", "true", "faces", "no truth")):
        told(capsys, ["explore", "--resume", str(tmp_path), "--max-steps", "6"], tmp_path)


def told(capsys, words, folder):
    before = sorted(folder.rglob("*"))
    assert main(words) == 2
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("chainslam: expected ")
    assert line.count(": ") >= 2
    assert sorted(folder.rglob("*")) == before


def test_what_is_no_log_at_all_gets_one_line_and_status_2(run, tmp_path, capsys):
    log = tmp_path / "log.npz"
    (tmp_path / "config.json").write_bytes((run / "config.json").read_bytes())
    np.save(tmp_path / "one.npy", np.arange(3.0))
    whole = (run / "log.npz").read_bytes()
    for content in ((tmp_path / "one.npy").read_bytes(), whole[: len(whole) // 2], b"", b"PK\x03\x04" + bytes(99)):
        log.write_bytes(content)
        told(capsys, ["replay", str(log)], tmp_path)
    with zipfile.ZipFile(run / "log.npz") as archive, zipfile.ZipFile(log, "w") as double:
        for name in archive.namelist():
            double.writestr(name, archive.read(name))
        with pytest.warns(UserWarning, match="Duplicate"):
            double.writestr("time_s.npy", archive.read("time_s.npy"))
    told(capsys, ["replay", str(log)], tmp_path)
    places = {
        "a folder": lambda: log.mkdir(),
        "a loop": lambda: log.symlink_to(log),
        "a link to nothing": lambda: log.symlink_to(tmp_path / "nothing"),
        "a pipe": lambda: os.mkfifo(log),
        "a device": lambda: log.symlink_to("/dev/zero"),
    }
    for make in places.values():
        log.unlink() if not log.is_dir() else log.rmdir()
        make()
        told(capsys, ["replay", str(log)], tmp_path)


def test_a_replay_knows_the_noise_that_grew_with_the_range(tmp_path):
    """The back end that drove gives the same poses again."""
    noise = ["--set", "robot.lidar.sigma_share=0.02", "--max-steps", "12"]
    assert main(["explore", "paper-fig4", *noise, "--out", str(tmp_path / "drive")]) == 0
    assert (
        main(["replay", str(tmp_path / "drive" / "log.npz"), "--backend", "graph", "--out", str(tmp_path / "again")])
        == 0
    )
    drive, again = (np.loadtxt(tmp_path / f / "trajectory_estimated.tum") for f in ("drive", "again"))
    assert len(drive) > 10
    np.testing.assert_array_equal(drive, again)
