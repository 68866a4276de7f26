"""A run's folder: held by one process, replaced by the same run alone."""

import fcntl
import os
import subprocess
import sys
from dataclasses import replace

import pytest

from chainslam.experiments.artifacts import run_folder
from chainslam.experiments.artifacts.results import RUN_FILES, config_record, write_results
from chainslam.experiments.artifacts.run_folder import LOCK, held, refuse_others, settle
from chainslam.experiments.commands.cli import main
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError
from tests.experiments.artifacts.run_folder.striking import ROOT, WORDS
from tests.experiments.commands.test_control import timeless


def test_the_same_run_replaces_itself_and_others_are_refused(whole, tmp_path, capsys):
    folder = tmp_path / "run"
    assert main([*WORDS, "--max-steps", "3", "--out", str(folder)]) == 0
    (folder / "thesis.txt").write_text("mine")
    (folder / "run.rrd").write_text("of the run before")
    assert main([*WORDS, "--max-steps", "3", "--out", str(folder)]) == 0
    assert not (folder / "run.rrd").exists()
    before = {path: path.read_bytes() for path in folder.iterdir()}
    capsys.readouterr()
    assert main([*WORDS, "--max-steps", "8", "--out", str(folder)]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert "another run (other max_steps)" in said
    assert "--force" in said
    assert {path: path.read_bytes() for path in folder.iterdir()} == before
    assert main([*WORDS, "--max-steps", "8", "--out", str(folder), "--force"]) == 0
    assert (folder / "thesis.txt").read_text() == "mine"
    (folder / "thesis.txt").unlink()
    assert timeless(folder) == timeless(whole)


@pytest.mark.parametrize(
    ("name", "content", "found"),
    [
        ("thesis.txt", b"mine", "found thesis.txt in"),
        ("config.json", b"[]", "found config.json in"),
        ("config.json", b'{"trial": []}', "found config.json in"),
        ("config.json", b'{"campaign": {}}', "found a campaign in"),
    ],
)
def test_what_is_no_run_is_refused_in_one_line_and_a_campaign_even_by_force(name, content, found, tmp_path, capsys):
    (tmp_path / name).write_bytes(content)
    for force in ([], ["--force"]):
        if force and "campaign" not in found:
            refuse_others(tmp_path, config_record(TrialConfig("paper-fig4")), force=True)
            continue
        assert main([*WORDS, "--max-steps", "3", "--out", str(tmp_path), *force]) == 2
        (said,) = capsys.readouterr().err.splitlines()
        assert found in said
    assert (tmp_path / name).read_bytes() == content
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_force_removes_what_a_run_writes_and_nothing_else(tmp_path):
    result = run_trial(TrialConfig("paper-fig4", "graph-batch", max_steps=3))
    assert write_results(replace(result, ending=replace(result.ending, traceback="trace")), tmp_path) == []
    written = {path.name for path in tmp_path.iterdir()}
    assert written <= set(RUN_FILES)
    assert len(written) >= 14
    (tmp_path / "replay-own").mkdir()
    (tmp_path / "notes.json").write_text("mine")
    settle(tmp_path, {"trial": {}})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["config.json", "notes.json", "replay-own"]


def test_two_runs_on_one_folder_the_second_is_refused(tmp_path, capsys):
    folder = tmp_path / "run"
    assert main([*WORDS, "--max-steps", "3", "--out", str(folder)]) == 0
    log, campaign = str(folder / "log.npz"), tmp_path / "campaign"
    campaign.mkdir()
    compare = [
        "compare", "--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot", "--trials", "1",
    ]  # fmt: skip
    commands = {
        folder: [*WORDS, "--max-steps", "3", "--out"],
        tmp_path / "again": ["replay", log, "--out"],
        campaign: [*compare, "--out"],
    }
    capsys.readouterr()
    for place, words in commands.items():
        place.mkdir(exist_ok=True)
        before = sorted(path.name for path in place.iterdir())
        with held(place):
            assert main([*words, str(place)]) == 2
            (said,) = capsys.readouterr().err.splitlines()
            assert "no other run uses" in said
            if place == folder:
                assert main(["explore", "--resume", str(place), "--max-steps", "4"]) == 2
                assert "no other run uses" in capsys.readouterr().err
        assert sorted(path.name for path in place.iterdir()) == before


def test_a_lock_is_let_go_by_the_kernel_and_missed_in_one_line_where_there_is_none(tmp_path, capsys, monkeypatch):
    holder = (
        "import os, sys; from pathlib import Path; from chainslam.experiments.artifacts.run_folder import held\n"
        "with held(Path(sys.argv[1])): os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", holder, str(tmp_path)], env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert (tmp_path / LOCK).exists()
    with held(tmp_path), pytest.raises(UsageError, match="no other run uses"), held(tmp_path):
        pass
    assert not (tmp_path / LOCK).exists()

    def no_locks(*_):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    with held(tmp_path):
        (said,) = capsys.readouterr().err.splitlines()
    assert "cannot be locked (No locks available)" in said


def test_a_lock_file_that_was_just_removed_is_not_taken_for_the_lock(tmp_path, monkeypatch):
    flock, calls = fcntl.flock, []

    def slow(descriptor, how):
        # Between opening and locking, the holder before lets go and takes its file away.
        if not calls:
            (tmp_path / LOCK).unlink()
        calls.append(descriptor)
        flock(descriptor, how)

    monkeypatch.setattr(run_folder.fcntl, "flock", slow)
    with held(tmp_path):
        assert len(calls) == 2
        assert (tmp_path / LOCK).exists()


def test_a_replay_replaces_itself_and_never_the_run_that_it_replays(whole, tmp_path, capsys):
    log = str(whole / "log.npz")
    before = timeless(whole)
    assert main(["replay", log, "--out", str(whole), "--force"]) == 2
    assert "a folder other than the log's" in capsys.readouterr().err
    for words, status in (([], 0), ([], 0), (["--association", "true"], 2), (["--association", "true", "--force"], 0)):
        assert main(["replay", log, *words, "--out", str(tmp_path / "out")]) == status
    assert "a replay of other options" in capsys.readouterr().err
    assert timeless(whole) == before
    assert main(["explore", "--resume", str(tmp_path / "out")]) == 2
    assert "that of a replay" in capsys.readouterr().err
