"""Estimators that are external programs: their poses are scored like ours, and whatever they do costs only them."""

import csv
import json
import shlex
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from chainslam.experiments.artifacts.results import write_results
from chainslam.experiments.campaign.comparison.consistency import OVERCONFIDENT, judge
from chainslam.experiments.campaign.merge import merge, union
from chainslam.experiments.campaign.plan import ARMS, Campaign, command_of
from chainslam.experiments.campaign.store import opened
from chainslam.experiments.commands.cli import main
from chainslam.experiments.replays.paths.external import ExternalConfig, register
from chainslam.experiments.replays.paths.process import ExternalError, running
from chainslam.experiments.replays.recordings import recorded
from chainslam.experiments.replays.replay import replay
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.statistics import estimate
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError
from chainslam.slam.backends import BACKENDS, BackendOptions
from chainslam.slam.evaluation.consistency import chi2_band, nees
from chainslam.slam.geometry.poses import compose, wrap
from examples.external_odometry import moved

ODOMETRY = [sys.executable, str(Path(__file__).parents[3] / "examples" / "external_odometry.py")]
UPPER = np.triu_indices(3)
FIRST = "sys.stdin.readline(); sys.stdin.readline(); print('{\"pose\": [0, 0, 0]}', flush=True)\n"
"""A program that answers the first scan as it should."""
STEPS = 12


@pytest.fixture(autouse=True)
def _registry():
    with patch.dict(BACKENDS):
        yield


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A short noisy run and the folder that it left."""
    result = run_trial(TrialConfig("paper-fig4", seed=3, max_steps=STEPS))
    folder = tmp_path_factory.mktemp("run")
    assert write_results(result, folder) == []
    return result, folder


@pytest.fixture
def program(tmp_path):
    """Write a program and return the words that start it."""

    def written(source, name="program"):
        path = tmp_path / f"{name}.py"
        path.write_text(f"import json, os, sys, time\n{source}")
        return [sys.executable, str(path)]

    return written


def ride(result, words, timeout_s=60.0):
    register([f"other={shlex.join(words)}"])
    run = recorded(result)
    options = BackendOptions(own={ExternalConfig.__name__: {"timeout_s": timeout_s}})
    return replay(replace(run, trial=replace(run.trial, backend_options=options)), "other")


def test_poses_stand_in_the_world_with_the_error_of_the_start_and_their_own(made):
    result, run = made[0], recorded(made[0])
    log = ride(result, ODOMETRY).log
    pose, cov = run.start_pose, run.start_cov
    for k in range(len(log)):
        if k:
            pose, cov = moved(pose, cov, run.recording.odometry[k], run.recording.odometry_cov[k])
        np.testing.assert_allclose(log.estimated_world[k], [*pose[:2], wrap(pose[2])], atol=1e-12)
        np.testing.assert_allclose(log.estimated_cov[k], cov, rtol=1e-9, atol=1e-15)
    # Relative to the start it is as if that had been known: the odometry from there alone.
    end, cov = log.from_start_world[0], np.diag([1e-8, 1e-8, 1e-10])
    for k in range(len(log)):
        if k:
            end, cov = moved(end, cov, run.recording.odometry[k], run.recording.odometry_cov[k])
        np.testing.assert_allclose(log.from_start_world[k], [*end[:2], wrap(end[2])], atol=1e-12)
        np.testing.assert_allclose(log.from_start_cov[k], cov, rtol=1e-6, atol=1e-15)


def test_it_is_told_the_scans_and_motions_of_the_recording(made, program, tmp_path):
    result, run = made[0], recorded(made[0])
    told = tmp_path / "told"
    words = program(
        f"file = open({str(told)!r}, 'w')\nfile.write(sys.stdin.readline())\n"
        "for line in sys.stdin:\n    file.write(line); file.flush(); print('{\"pose\": [0, 0, 0]}', flush=True)\n"
    )
    assert ride(result, words).ending.status == "complete"
    header, *lines = map(json.loads, told.read_text().splitlines())
    recording = run.recording
    assert header["chainslam"] == 1
    assert header["scans"] == len(lines) == STEPS
    assert header["scanner"] == [0.0, 0.0, 0.0]
    assert header["range_max_m"] == recording.range_max_m
    np.testing.assert_array_equal(header["bearings_rad"], recording.bearings_rad)
    for k, line in enumerate(lines):
        assert (line["scan"], line["time_s"]) == (k, recording.time_s[k])
        np.testing.assert_array_equal(line["motion"], recording.odometry[k])
        np.testing.assert_array_equal(line["motion_covariance"], recording.odometry_cov[k][UPPER])
        ranges = np.where(np.isfinite(recording.ranges_m[k]), recording.ranges_m[k], np.nan)
        np.testing.assert_array_equal(np.array(line["ranges_m"], dtype=float), ranges)
    assert any(None in line["ranges_m"] for line in lines) == (not np.all(np.isfinite(recording.ranges_m)))


def test_odometry_with_the_covariance_that_it_adds_up_to_is_consistent_and_with_half_of_it_overconfident():
    rng, motion_cov = np.random.default_rng(1), np.diag([1e-4, 4e-5, 1e-4])
    true, runs = np.array([0.3, 0.0, 0.2]), 24
    found = {1.0: [], 0.5: []}
    for times, values in found.items():
        for _ in range(runs):
            pose, own = np.zeros(3), []
            with running([*ODOMETRY, "--times", str(times)], 60.0) as program:
                for k in range(15):
                    motion = true + rng.multivariate_normal(np.zeros(3), motion_cov) if k else np.zeros(3)
                    pose = compose(pose, true) if k else pose
                    cov = motion_cov if k else np.zeros((3, 3))
                    line = {"scan": k, "motion": motion.tolist(), "motion_covariance": cov[UPPER].tolist()}
                    said = json.loads(program.ask(json.dumps(line).encode() + b"\n", b"" if k else b"{}\n"))
                    stated = np.zeros((3, 3))
                    stated[UPPER] = stated.T[UPPER] = said["covariance"]
                    error = np.array(said["pose"]) - pose
                    error[2] = wrap(error[2])
                    own += [nees(error[None], stated[None])[0]] if k else []
                program.finish()
            values.append(float(np.mean(own)) / 3.0)
    low, high = (value / 3.0 for value in chi2_band(3, runs=runs))
    assert low < np.mean(found[1.0]) < high
    half = estimate({("", k): value for k, value in enumerate(found[0.5])})
    assert high < half.mean
    assert judge(vars(half)) == OVERCONFIDENT


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("sys.exit('no licence')", "after 0 of 12 scans, it ended with status 1: no licence"),
        (FIRST + "import nothing_of_that_name", "after 1 of 12 scans, it ended with status 1: ModuleNotFoundError"),
        (FIRST, "after 1 of 12 scans, it ended with status 0"),
        (FIRST + "os.kill(os.getpid(), 9)", "after 1 of 12 scans, it was ended by signal 9"),
        (FIRST + "print('loading'); sys.stdout.flush(); time.sleep(60)", "after 1 of 12 scans, it wrote 'loading'"),
        (FIRST + "print('{\"pose\": [1, 2]}')", "which is no pose (Expected `array` of length 3"),
        (FIRST + "print('{\"pose\": [1, 2, NaN]}')", "which is no pose (JSON is malformed"),
        (FIRST + "print('{\"pose\": [1, 2, 1e999]}')", "which is no pose (Number out of range"),
        (FIRST + 'print(\'{"pose": [1, 2, 0], "covariance": [1, 2, 0, 1, 0, 1]}\')', "is not positive definite"),
        (FIRST + 'print(\'{"pose": [1, 2, 0], "covariance": [0, 0, 0, 0, 0, 0]}\')', "is not positive definite"),
        (FIRST + 'print(\'{"pose": [1, 2, 0], "covariance": [1, 0, 0]}\')', "which is no pose"),
        (FIRST + "print('{\"pose\": [1, 2e7, 0]}')", "which is beyond 1e+06"),
        ("print('{\"pose\": [7, 0, 0]}')", "the first pose is the frame of the others"),
        (FIRST + "print(b'\\xff'.decode('latin1') * 70000)", "which is no pose"),
        (
            "for line in sys.stdin:\n    print('{\"pose\": [0, 0, 0]}', flush=True)\n",  # the header, too
            "after 11 of 12 scans, it wrote more lines than there were scans",
        ),
    ],
)
@pytest.mark.usefixtures("_unchecked")
def test_a_program_that_fails_is_told_in_one_line(made, program, source, words):
    ending = ride(made[0], program(source)).ending
    assert ending.status == "failed"
    assert words in ending.reason
    assert "\n" not in ending.reason


@pytest.mark.parametrize("source", ["time.sleep(60)", "os.close(1)\ntime.sleep(60)"])
def test_a_program_that_answers_too_late_is_ended(program, source):
    with (
        running(program(f"sys.stderr.write('waiting')\nsys.stderr.flush()\n{source}"), 0.4) as late,
        pytest.raises(ExternalError, match=r"no answer within 0\.4 s|it closed its standard output"),
    ):
        late.ask(b"{}\n")
    assert late._popen.poll() is not None


def test_a_program_that_reads_nothing_and_fills_its_standard_error_is_ended_too(program):
    source = "sys.stderr.write('x' * 100000 + '\\nlast words\\n')\nsys.stderr.flush()\ntime.sleep(60)"
    with running(program(source), 0.4) as deaf, pytest.raises(ExternalError, match=r"within 0\.4 s: last words"):
        deaf.ask(b" " * 1_000_000 + b"\n")


def test_of_a_line_without_an_end_no_more_is_read_than_an_answer_may_have(program):
    with running(program("while True: os.write(1, b'x' * 100_000)"), 20.0) as endless:
        assert len(endless.ask(b"{}\n")) == 65_536


def test_a_program_that_does_not_start_is_told(made, tmp_path):
    broken = tmp_path / "broken"
    broken.write_text("#!/no/such/interpreter\n")
    broken.chmod(0o755)
    assert "does not start" in ride(made[0], [str(broken)]).ending.reason


@pytest.mark.parametrize(
    ("said", "found"),
    [
        ("kiss", "NAME of letters"), ("=python", "NAME of letters"), ("../up=python", "NAME of letters"),
        ("a=", "NAME of letters"), ("a='open", "No closing quotation"), ("a=no-such-program -x", "no-such-program"),
        ("full-ekf=true", "found full-ekf twice"), ("paper-method=true", "found paper-method twice"),
    ],
)  # fmt: skip
def test_what_is_no_program_is_refused_before_anything_runs(said, found):
    with pytest.raises(UsageError, match=found):
        register([said])


def test_a_campaign_has_a_column_for_each_and_a_lost_one_costs_no_other(program, tmp_path, capsys):
    silent = program(
        "sys.stdin.readline()\nfor line in sys.stdin: print('{\"pose\": [0, 0, 0]}', flush=True)", "silent"
    )
    lost = program(FIRST + "sys.exit('out of memory')", "lost")
    words = ["compare", "--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot"]
    words += ["--trials", "1", "--max-steps", str(STEPS), "--jobs", "1", "--out", str(tmp_path / "out")]
    others = {"odometry": ODOMETRY, "silent": silent, "lost": lost}
    for name, command in others.items():
        words += ["--external", f"{name}={shlex.join(command)}"]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "silent: no covariance stated, path error" in said
    assert (
        "lost: 1 of 1 drives lost (ExternalError: after 1 of 12 scans, it ended with status 1: out of memory)" in said
    )
    rows = list(csv.DictReader((tmp_path / "out" / "trials.csv").read_text().splitlines()))
    found = {(row["backend"], row["mode"], row["association"]): row for row in rows}
    assert [key for key in found if key[0] in others] == [(name, "replay", "own") for name in others]
    assert len(found) == 3 + len(others)
    odometry, ours = found["odometry", "replay", "own"], found["full-ekf", "replay", "own"]
    assert float(odometry["pose_anees_from_start"]) > 0.0
    assert [odometry[name] for name in ("map_anees", "lines", "false_matches", "coverage")] == [""] * 4
    assert float(ours["lines"]) > 0
    assert float(odometry["odometry_rmse_m"]) == float(ours["odometry_rmse_m"])
    assert found["silent", "replay", "own"]["pose_anees"] == ""
    assert float(found["silent", "replay", "own"]["ate_m"]) > 0.0
    assert main(["report", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "no covariance stated" in page
    assert "--external" in page
    # The same command goes on, and another program under the same name is another campaign.
    capsys.readouterr()
    assert main(words) == 0
    words[words.index(f"lost={shlex.join(lost)}")] = f"other={shlex.join(lost)}"
    assert main(words) == 2
    assert "found other backends, external" in capsys.readouterr().err


def test_merged_campaigns_have_one_program_under_a_name(tmp_path):
    first = Campaign(("paper-fig4",), ("full-ekf", "other"), ("nearest-robot",), 1, external=(("other", "true"),))
    second = replace(first, first_seed=2, external=(("other", "false"),))
    for name, campaign in (("first", first), ("second", second)):
        with opened(tmp_path / name, campaign):
            pass
    with pytest.raises(UsageError, match="one estimator other, found 2 of other commands"):
        merge([tmp_path / "first", tmp_path / "second"], tmp_path / "whole")
    plain = replace(first, backends=("full-ekf",), external=())
    assert union([plain, first]).external == first.external
    assert (union([plain, first]).arms_of("other"), plain.arms_of("full-ekf")) == (("replay-own",), ARMS)
    assert "--backends full-ekf --external other=true" in command_of(first)


def test_a_program_cannot_drive_and_needs_replays_with_its_own_matches(tmp_path, capsys):
    words = ["compare", "--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot"]
    words += ["--trials", "1", "--external", "odometry=true", "--out", str(tmp_path)]
    for more, found in ((("--driver", "odometry"), "--driver"), (("--modes", "closed"), "--modes replay")):
        assert main([*words, *more]) == 2
        assert found in capsys.readouterr().err


def test_a_replay_leaves_what_an_audit_reads(made, tmp_path, capsys):
    out, log = tmp_path / "out", str(made[1] / "log.npz")
    assert main(["replay", log, "--external", f"odometry={shlex.join(ODOMETRY)}", "--out", str(out)]) == 0
    assert "pose ANEES" in capsys.readouterr().out
    assert {path.name for path in out.iterdir()} >= {"steps.csv", "trajectory_estimated.tum", "map.png"}
    assert main(["audit", str(out)]) == 0
    assert "ANEES" in capsys.readouterr().out
