"""What a run that was killed or interrupted keeps, and how it goes on."""

import json
import os
import signal
import subprocess
import sys

import pytest

from chainslam.experiments.artifacts.run_folder import LOCK
from chainslam.experiments.artifacts.saved import read_saved
from chainslam.experiments.commands.cli import main
from tests.experiments.artifacts.run_folder.striking import ROOT, WORDS, parts, struck
from tests.experiments.commands.test_control import timeless


@pytest.mark.parametrize(
    ("place", "nth", "steps"),
    [
        pytest.param("file", 1, None, marks=pytest.mark.long),
        pytest.param("file", 2, 0, marks=pytest.mark.long),
        pytest.param("step", 1, 0, marks=pytest.mark.long),
        ("torn", 4, 3),
        ("file", 6, 8),
        pytest.param("removed", 1, 8, marks=pytest.mark.long),
    ],
    ids=lambda value: str(value),
)
def test_killed_at_any_place_it_goes_on_to_the_same_bytes(place, nth, steps, whole, tmp_path, capsys):
    folder = tmp_path / "run"
    assert struck(place, signal.SIGKILL, nth, folder).returncode == -signal.SIGKILL
    assert bool(parts(folder)) == (place == "file")
    if steps is None:
        # Nothing was written that says which run it was: the same command begins anew.
        assert [path.name for path in folder.iterdir() if path.name != LOCK] == parts(folder)
        assert main([*WORDS, "--max-steps", "8", "--out", str(folder)]) == 0
    else:
        saved = read_saved(folder)
        assert len(saved) == steps
        assert saved.trial.max_steps == 8
        assert main(["explore", "--resume", str(folder)]) == 0
    assert timeless(folder) == timeless(whole)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.long)])
def test_sigterm_and_sighup_finish_the_step_and_write_the_results(number, whole, tmp_path):
    folder = tmp_path / "run"
    ended = struck("step", number, 3, folder)
    assert ended.returncode == 130
    assert ended.stderr.splitlines() == [f"chainslam: stopped: interrupted by {number.name}"]
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["steps"], summary["outcome"]) == (3, "interrupted")
    assert {path.name for path in folder.iterdir()} == {path.name for path in whole.iterdir()}
    # The second one comes while a file is written: what is there is whole, and it goes on from there.
    again = struck("file", number, 4, folder, "explore", "--resume", str(folder))
    assert again.returncode == 130
    assert not parts(folder)
    assert "Traceback" not in again.stderr
    assert main(["explore", "--resume", str(folder)]) == 0
    assert timeless(folder) == timeless(whole)


def test_a_finished_run_is_left_alone_and_a_raised_limit_goes_on(whole, tmp_path, capsys):
    folder = tmp_path / "run"
    assert main([*WORDS, "--max-steps", "5", "--out", str(folder)]) == 0
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.iterdir()}
    capsys.readouterr()
    for words in ([], ["--max-steps", "5"]):
        assert main(["explore", "--resume", str(folder), *words]) == 0
        said = capsys.readouterr()
        assert said.err == ""
        (line,) = said.out.splitlines()
        assert line.startswith(f"the run in {folder} is finished (stopped: step-limit; raise the limit")
    assert main(["explore", "--resume", str(folder), "--max-steps", "4"]) == 2
    assert "unchanged" in capsys.readouterr().err
    assert {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.iterdir()} == before
    assert main(["explore", "--resume", str(folder), "--max-steps", "8"]) == 0
    assert timeless(folder) == timeless(whole)


def test_a_killed_resume_keeps_the_new_limit_and_the_old_results(whole, tmp_path):
    folder = tmp_path / "run"
    assert main([*WORDS, "--max-steps", "5", "--out", str(folder)]) == 0
    before = (folder / "summary.json").read_bytes()
    words = ["explore", "--resume", str(folder), "--max-steps", "8"]
    assert struck("step", signal.SIGKILL, 3, folder, *words).returncode == -signal.SIGKILL
    assert (folder / "summary.json").read_bytes() == before
    assert len(read_saved(folder)) == 5
    assert main(["explore", "--resume", str(folder)]) == 0
    assert timeless(folder) == timeless(whole)


@pytest.mark.long
def test_an_interrupted_replay_keeps_whole_steps_and_goes_no_further(whole, tmp_path):
    words = ["replay", str(whole / "log.npz"), "--backend", "block-ekf", "full-ekf", "--out", str(tmp_path / "out")]
    ended = struck("replay", signal.SIGTERM, 3, tmp_path, *words)
    assert ended.returncode == 130, ended.stderr
    assert json.loads((tmp_path / "out" / "block-ekf" / "summary.json").read_text())["steps"] == 3
    assert not list((tmp_path / "out" / "full-ekf").iterdir())


@pytest.mark.long
def test_runs_and_campaigns_killed_at_random_moments_come_to_the_same_bytes():
    command = [sys.executable, "-m", "studies.kills", "--explore", "3", "--compare", "2", "--steps", "20"]
    told = subprocess.run(command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
    assert told.returncode == 0, told.stdout + told.stderr
    assert told.stdout.splitlines()[-1] == "nothing was lost"
    assert told.stdout.count("the same bytes") == 5
