"""A recording played back: identical scans, the back end alone, the truth in place of a part."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.artifacts.reading import read_json
from chainslam.experiments.artifacts.results import write_results
from chainslam.experiments.commands.cli import main
from chainslam.experiments.replays.oracles import true_odometry
from chainslam.experiments.replays.recordings import recorded
from chainslam.experiments.replays.replay import ReplayedRobot, ReplayOptions, read_run, replay
from chainslam.experiments.scenario import TrialConfig, sigmas_of
from chainslam.experiments.trial import run_trial
from chainslam.sim.logs.recorded_robot import RecordedRobot
from chainslam.slam.backends import BACKENDS, BackendOptions
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.evaluation.from_start import Start
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.geometry.poses import compose, wrap
from chainslam.slam.robot import MotionCommand


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A short noisy run and the folder that it left."""
    result = run_trial(TrialConfig("paper-fig4", seed=3, max_steps=60))
    folder = tmp_path_factory.mktemp("run")
    assert write_results(result, folder) == []
    return result, folder


def test_the_same_back_end_gives_the_same_estimate_bit_for_bit(made):
    result, folder = made
    again = replay(read_run(folder / "log.npz"), "full-ekf")
    np.testing.assert_array_equal(again.log.estimated_world, result.log.estimated_world)
    np.testing.assert_array_equal(again.log.estimated_cov, result.log.estimated_cov)


def test_a_replay_of_a_drive_that_was_cut_short_says_so_and_is_not_complete(made, tmp_path, capsys):
    result, folder = made
    reason = "the recording ends early (the limit of 60 steps)"
    once, twice = tmp_path / "once", tmp_path / "twice"
    for source, out in ((folder, once), (once, twice)):
        assert main(["replay", str(source / "log.npz"), "--out", str(out)]) == 0
        assert f"({reason})" in capsys.readouterr().out
        summary = read_json(out / "summary.json", dict, "")
        assert summary["status"] == "stopped"
        assert summary["outcome"] == "recording-cut-short"
        assert summary["reason"] == reason
    whole = replay(recorded(result), "full-ekf").ending
    assert (whole.status, whole.reason) == ("complete", "the recording has ended")


def test_where_the_robot_was_carried_a_replay_counts_no_path(made):
    run = recorded(made[0])
    carried = np.arange(len(run.recording)) == 7
    robot = ReplayedRobot(run, replace(run.recording, carried=carried))
    for _ in carried[1:]:
        robot.drive(MotionCommand(0.0, 0.0))
    driven = np.hypot(*run.recording.odometry[~carried, :2].T).sum()
    assert robot.record.path_length_m == pytest.approx(driven)


def test_a_log_on_disk_replays_like_the_run_in_memory(made):
    result, folder = made
    on_disk = replay(read_run(folder / "log.npz"), "invariant-ekf").log
    in_memory = replay(recorded(result), "invariant-ekf").log
    np.testing.assert_array_equal(on_disk.estimated_world, in_memory.estimated_world)


@pytest.mark.parametrize("name", ["full-ekf", "graph"])
def test_the_pose_relative_to_the_start_is_scored_as_had_the_start_been_known(made, name):
    """By the true association, which no estimate can sway, the replay with `--p0 zero` tells the same number."""
    run = recorded(made[0])
    true = run.true_poses_world[0]
    known = Start(run.start_pose, run.start_cov, true).known(sigmas_of("zero"))
    trial = replace(run.trial, p0="zero")
    zero = replace(run, trial=trial, start_pose=known.estimate_world, start_cov=known.cov)
    options = ReplayOptions("true", perfect_extraction=True)
    found, expected = (replay(each, name, options).summary for each in (run, zero))
    assert expected["pose_anees_from_start"] == expected["pose_anees"]
    exact = not BACKENDS[name].carries_start
    assert found["pose_anees_from_start"] == pytest.approx(expected["pose_anees"], rel=1e-9 if exact else 0.02)
    assert found["pose_anees"] != pytest.approx(expected["pose_anees"], rel=0.1)


def test_the_true_association_makes_one_line_of_each_wall_and_no_false_match(made):
    result, _ = made
    again = replay(recorded(result), "full-ekf", ReplayOptions("true"))
    assert again.summary["false_matches"] == again.summary["duplicate_lines"] == 0
    walls = again.votes.walls_of(again.last.map.ids)
    assert len(set(walls.tolist())) == len(walls)


def test_perfect_extraction_is_off_by_the_stated_noise(made):
    result, _ = made
    run = recorded(result)
    again = replay(run, "full-ekf", ReplayOptions("true", perfect_extraction=True))
    segments = again.last.segments
    faces = again.votes.truth.lines
    pose = run.true_poses_world[-1]
    in_robot = np.column_stack(
        [faces[:, 0] - pose[2], faces[:, 1] - np.cos(faces[:, 0]) * pose[0] - np.sin(faces[:, 0]) * pose[1]]
    )
    for line, cov in zip(segments.lines, segments.cov, strict=True):
        off = in_robot - line
        off[:, 0] = (off[:, 0] + np.pi) % (2 * np.pi) - np.pi
        nearest = np.einsum("fi,ij,fj->f", off, np.linalg.inv(cov), off).min()
        assert 0.0 < nearest < 30.0


def test_true_motions_lead_along_the_true_path(made):
    poses = recorded(made[0]).true_poses_world
    at = poses[0]
    for motion, pose in zip(true_odometry(poses)[1:], poses[1:], strict=True):
        at = compose(at, motion)
        np.testing.assert_allclose(at, pose, atol=1e-9)


def test_a_recording_ends(made):
    recording = recorded(made[0]).recording
    robot = RecordedRobot(recording)
    for _ in range(len(recording) - 1):
        robot.sense()
        robot.drive(MotionCommand(0.0, 0.0))
    with pytest.raises(EOFError, match="end of the recording"):
        robot.drive(MotionCommand(0.0, 0.0))


def test_what_is_no_log_gets_one_line_and_status_2(made, tmp_path, capsys):
    _, folder = made
    (tmp_path / "log.npz").write_bytes(b"not an archive")
    alone = tmp_path / "alone"
    alone.mkdir()
    (alone / "log.npz").write_bytes((folder / "log.npz").read_bytes())
    for log in (tmp_path / "none.npz", tmp_path / "log.npz", alone / "log.npz", tmp_path):
        assert main(["replay", str(log)]) == 2
        said = capsys.readouterr().err.strip()
        assert said.startswith("chainslam: expected")
        assert "\n" not in said
        assert "found" in said


@pytest.mark.parametrize("perfect_extraction", [False, True])
def test_a_replay_goes_by_its_runs_options_of_the_back_end_and_settings_of_the_extraction(made, perfect_extraction):
    """Where no segment has beams enough nothing is mapped, whoever extracts."""
    run = recorded(made[0])
    mapper = replace(run.trial.mission.mapper, extraction=ExtractionConfig(least_beams=1000))
    options = BackendOptions(EkfConfig(at_wall=False))
    trial = replace(run.trial, mission=replace(run.trial.mission, mapper=mapper), backend_options=options)
    again = replay(replace(run, trial=trial), "full-ekf", ReplayOptions("own", perfect_extraction))
    assert again.scenario.backend.config is options.ekf
    assert len(again.last.map) == 0


@pytest.mark.parametrize("robot", ["paper", "front-scanner"])
def test_a_drive_by_its_scans_keeps_what_the_wheels_reported_and_replays_bit_for_bit(tmp_path, robot):
    folder = tmp_path / "run"
    words = ["explore", "paper-fig4", "--backend", "full-ekf", "--odometry", "scans", "--robot", robot]
    assert main([*words, "--seed", "3", "--max-steps", "30", "--out", str(folder)]) == 0
    assert main(["explore", "--resume", str(folder), "--max-steps", "60"]) == 0
    run = read_run(folder / "log.npz")
    again = replay(run, "full-ekf").log
    np.testing.assert_array_equal(again.odometry[1:], run.recording.odometry[1:])
    estimated = np.loadtxt(folder / "trajectory_estimated.tum")[:, 1:3]
    np.testing.assert_allclose(again.estimated_world[:, :2], estimated, atol=1e-8)
    true = true_odometry(run.true_poses_world)
    scans, wheels = (np.abs(wrap((each - true)[1:, 2])).mean() for each in (again.heard, again.odometry))
    assert scans < 0.5 * wheels
    by_wheels = replay(run, "full-ekf", ReplayOptions(odometry="wheels")).log
    np.testing.assert_array_equal(by_wheels.heard, by_wheels.odometry)
