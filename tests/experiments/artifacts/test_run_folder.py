"""A run's folder: held by one process, replaced by the same run alone, whole whatever happens to it."""

import fcntl
import json
import os
import resource
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jaxtyping
import numpy as np
import pytest

from experiments.artifacts import run_folder, running_log
from experiments.artifacts.results import RUN_FILES, config_record, write_results
from experiments.artifacts.run_folder import LOCK, FolderGoneError, held, refuse_others, settle
from experiments.artifacts.running_log import RunningLog, read_running
from experiments.artifacts.saved import read_saved
from experiments.commands.cli import main
from experiments.scenario import TrialConfig
from experiments.trial import run_trial
from experiments.usage import UsageError
from tests.experiments.commands.test_control import timeless

ROOT = Path(__file__).parents[3]
WORDS = ["explore", "paper-fig4", "--seed", "2", "--no-sweep"]
FULL = (
    "chainslam: expected room on standard output, found [Errno 28] No space left on device: files were written all the"
    " same"
)
STRUCK = """
import os, signal, sys
from contextlib import contextmanager
from types import SimpleNamespace
from experiments.artifacts import running_log
from experiments.commands import cli, replay

place, number, nth = sys.argv.pop(1), int(sys.argv.pop(1)), int(sys.argv.pop(1))
# Under nohup a process is born deaf to SIGHUP.
signal.signal(signal.SIGHUP, signal.SIG_DFL)

def strike(*_):
    global nth
    nth -= 1
    if not nth:
        os.kill(os.getpid(), number)

def before(owner, name):
    act = getattr(owner, name)
    def struck(*arguments):
        strike()
        return act(*arguments)
    setattr(owner, name, struck)

@contextmanager
def strikes(title, steps):
    yield strike

if place == "step":
    before(running_log.RunningLog, "add")
elif place == "torn":
    write = os.write
    def torn(descriptor, content):
        if descriptor <= 2:
            return write(descriptor, content)
        if nth == 1:
            write(descriptor, content[:700])
        strike()
        return write(descriptor, content)
    running_log.os = SimpleNamespace(**vars(os) | {"write": torn})
elif place == "file":
    before(os, "fsync")
elif place == "removed":
    before(running_log.RunningLog, "remove")
elif place == "replay":
    replay.progress = strikes
sys.exit(cli.main())
"""
"""The command, which sends itself a signal at the nth time that it comes to a place."""


@pytest.fixture(autouse=True, scope="module")
def _fast():
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What an undisturbed run of eight steps leaves."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    assert main([*WORDS, "--max-steps", "8", "--out", str(folder)]) == 0
    return folder


def struck(place, number, nth, folder, *words):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", STRUCK, place, str(int(number)), str(nth), *(words or WORDS)]
    limits = [] if words else ["--max-steps", "8", "--out", str(folder)]
    return subprocess.run([*command, *limits], env=environment, capture_output=True, text=True)


def parts(folder):
    return [path.name for path in folder.rglob("*") if path.name.endswith(".part")]


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
        assert (
            said.out
            == f"the run in {folder} is finished (stopped: step-limit; raise the limit to go on): nothing done\n"
        )
    assert main(["explore", "--resume", str(folder), "--max-steps", "4"]) == 2
    assert "left as they were" in capsys.readouterr().err
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
            assert "another run at work" in said
            if place == folder:
                assert main(["explore", "--resume", str(place), "--max-steps", "4"]) == 2
                assert "another run at work" in capsys.readouterr().err
        assert sorted(path.name for path in place.iterdir()) == before


def test_a_lock_is_let_go_by_the_kernel_and_missed_in_one_line_where_there_is_none(tmp_path, capsys, monkeypatch):
    holder = (
        "import os, sys; from pathlib import Path; from experiments.artifacts.run_folder import held\n"
        "with held(Path(sys.argv[1])): os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", holder, str(tmp_path)], env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert (tmp_path / LOCK).exists()
    with held(tmp_path), pytest.raises(UsageError, match="another run at work"), held(tmp_path):
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


def gone(folder, step):
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()


@pytest.mark.parametrize("at", [3, 8])
def test_a_folder_that_vanishes_is_one_line_and_status_1(at, tmp_path, capsys, monkeypatch):
    folder, add = tmp_path / "run", RunningLog.add

    def add_and_lose(log, step):
        add(log, step)
        if step.index + 1 == at:
            gone(folder, step)

    monkeypatch.setattr(RunningLog, "add", add_and_lose)
    assert main([*WORDS, "--max-steps", "8", "--out", str(folder)]) == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"chainslam: expected the folder {folder} to stay, found it gone")
    assert not folder.exists()


def test_a_campaign_whose_folder_vanishes_is_one_line_and_status_1(tmp_path, capsys, monkeypatch):
    from experiments.campaign.store import Store

    folder, save = tmp_path / "campaign", Store.save

    def lose_and_save(store, done):
        gone(folder, done)
        save(store, done)

    monkeypatch.setattr(Store, "save", lose_and_save)
    words = ["--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot", "--trials", "1"]
    assert main(["compare", *words, "--max-steps", "2", "--jobs", "1", "--out", str(folder)]) == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert "to stay, found it gone" in said
    assert not folder.exists()


@pytest.mark.parametrize("limit", [12_000, 40_000])
def test_a_disk_that_is_full_costs_one_line_and_keeps_what_fits(limit, whole, tmp_path, capsys):
    folder = tmp_path / "run"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        status = main([*WORDS, "--max-steps", "8", "--out", str(folder)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert status == 1
    (said,) = capsys.readouterr().err.splitlines()
    too_large = [path.name for path in whole.iterdir() if path.stat().st_size > limit]
    assert too_large
    assert said.startswith("chainslam: not written: ")
    assert said.endswith(": File too large")
    assert sorted(said.split(": ")[2].split(", ")) == sorted(too_large)
    kept = read_running(folder)
    assert 0 < len(kept.time_s) < 8 if limit < 20_000 else len(kept.time_s) == 8
    assert main(["explore", "--resume", str(folder)]) == 0
    assert timeless(folder) == timeless(whole)


@pytest.mark.parametrize(
    ("reader", "status", "lines"),
    [("gone", 0, []), ("full", 1, [FULL])],
)
def test_output_that_nobody_takes_costs_no_results(reader, status, lines, whole, tmp_path):
    folder = tmp_path / "run"
    read, write = os.pipe()
    os.close(read)
    if reader == "full":
        os.dup2(os.open("/dev/full", os.O_WRONLY), write)
    command = [sys.executable, "-m", "experiments.commands.cli", *WORDS, "--max-steps", "8", "--out", str(folder)]
    ended = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=write, stderr=subprocess.PIPE, text=True
    )
    os.close(write)
    assert (ended.returncode, ended.stderr.splitlines()) == (status, lines)
    assert timeless(folder) == timeless(whole)


def test_the_stream_holds_every_step_bit_for_bit_and_drops_what_was_cut_short(tmp_path):
    result = run_trial(TrialConfig("paper-fig4", seed=2, max_steps=4))
    log, steps = RunningLog(tmp_path, {"trial": 1}), []
    run_trial(TrialConfig("paper-fig4", seed=2, max_steps=4), lambda step: (log.add(step), steps.append(step)))
    log.close()
    kept = read_running(tmp_path)
    np.testing.assert_array_equal(kept.ranges_m, result.log.ranges_m)
    np.testing.assert_array_equal(kept.odometry, result.log.odometry)
    np.testing.assert_array_equal(kept.time_s, result.log.time_s)
    content = (tmp_path / "log.arrow").read_bytes()
    for cut in (1, 700, 1500):
        (tmp_path / "log.arrow").write_bytes(content[:-cut])
        short = read_running(tmp_path)
        assert len(short.time_s) == 3
        # Going on behind the whole ones, as if nothing had been cut.
        more = RunningLog(tmp_path, {"trial": 1}, short)
        for step in steps:
            more.add(step)
        more.close()
        assert (tmp_path / "log.arrow").read_bytes() == content
    (tmp_path / "log.arrow").write_bytes(b"none of ours")
    with pytest.raises(UsageError, match=r"^expected the log of a run under way, found .*: .*$"):
        read_running(tmp_path)


def test_a_step_that_was_written_in_part_is_taken_back_and_ends_the_stream(tmp_path, monkeypatch):
    log, steps = RunningLog(tmp_path, {"trial": 1}), []
    run_trial(TrialConfig("paper-fig4", seed=2, max_steps=3), steps.append)
    log.add(steps[0])
    before, write = (tmp_path / "log.arrow").read_bytes(), os.write
    monkeypatch.setattr(running_log.os, "write", lambda descriptor, content: write(descriptor, content[:900]))
    log.add(steps[1])
    monkeypatch.undo()
    # There is room again, but behind a gap no step can be read.
    log.add(steps[2])
    assert (tmp_path / "log.arrow").read_bytes() == before
    assert len(read_running(tmp_path).time_s) == 1


def test_a_stream_that_was_taken_away_is_noticed_at_the_next_step(tmp_path):
    log = RunningLog(tmp_path, {"trial": 1})
    log.check()
    (tmp_path / "log.arrow").rename(tmp_path / "elsewhere")
    with pytest.raises(FolderGoneError):
        log.check()


def test_a_replay_replaces_itself_and_never_the_run_that_it_replays(whole, tmp_path, capsys):
    log = str(whole / "log.npz")
    before = timeless(whole)
    assert main(["replay", log, "--out", str(whole), "--force"]) == 2
    assert "another folder than that of the log" in capsys.readouterr().err
    for words, status in (([], 0), ([], 0), (["--association", "true"], 2), (["--association", "true", "--force"], 0)):
        assert main(["replay", log, *words, "--out", str(tmp_path / "out")]) == status
    assert "a replay of other options" in capsys.readouterr().err
    assert timeless(whole) == before
    assert main(["explore", "--resume", str(tmp_path / "out")]) == 2
    assert "that of a replay" in capsys.readouterr().err


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
