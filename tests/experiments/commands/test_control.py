"""How a run is stopped, and how it goes on."""

import csv
import gc
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.artifacts.results import config_record
from chainslam.experiments.artifacts.saved import read_trial
from chainslam.experiments.commands import cli
from chainslam.experiments.commands.cli import main
from chainslam.experiments.scenario import MappingMissionConfig, TrialConfig
from chainslam.experiments.scoring.summary import TIMED
from chainslam.experiments.terminal.interrupts import STOPS, first_interrupt_waits, nothing_half_built_speaks
from chainslam.experiments.usage import UsageError
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.sim.logs.recorded_robot import FORMAT

ROOT = Path(__file__).parents[3]


def timeless(folder):
    """Return the bytes of a run's files without the times that its steps took."""
    contents = {path.name: path.read_bytes() for path in folder.iterdir()}
    summary = json.loads(contents["summary.json"])
    contents["summary.json"] = json_bytes({key: value for key, value in summary.items() if key not in TIMED})
    rows = list(csv.reader(io.StringIO(contents["steps.csv"].decode())))
    contents["steps.csv"] = [row[:-1] for row in rows]
    return contents


def test_a_resumed_run_leaves_the_bytes_of_one_that_was_never_stopped(tmp_path, capsys):
    stopped, whole = tmp_path / "stopped", tmp_path / "whole"
    explore = ["explore", "paper-fig8", "--seed", "3", "--no-sweep", "--p0", "large"]
    assert main([*explore, "--max-path", "1.5", "--out", str(stopped)]) == 0
    before = json.loads((stopped / "summary.json").read_text())
    assert before["certificate"]["outcome"] == "path-limit"
    assert 1.5 <= before["path_length_m"] < 1.7
    assert main(["explore", "--resume", str(stopped), "--max-steps", "45"]) == 0
    assert main([*explore, "--max-steps", "45", "--out", str(whole)]) == 0
    assert json.loads((whole / "summary.json").read_text())["steps"] == 45 > before["steps"]
    assert timeless(stopped) == timeless(whole)
    # A limit that lies before the end of the saved run costs it nothing.
    assert main(["explore", "--resume", str(stopped), "--max-steps", "20"]) == 2
    assert timeless(stopped) == timeless(whole)
    assert "unchanged" in capsys.readouterr().err


def test_a_run_that_cannot_be_driven_again_is_told(tmp_path, capsys):
    assert main(["explore", "paper-fig8", "--max-steps", "4", "--out", str(tmp_path)]) == 0
    with np.load(tmp_path / "log.npz") as log:
        arrays = dict(log)
    arrays["ranges_m"][2, 5] += 0.5
    np.savez(tmp_path / "log.npz", **arrays)
    capsys.readouterr()
    assert main(["explore", "--resume", str(tmp_path), "--max-steps", "6"]) == 2
    said = capsys.readouterr().err
    assert "at step 2 " in said
    assert len(said.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["--resume", "nowhere"],
        ["--resume", ".", "--max-path", "0"],
        ["paper-fig8", "--resume", "."],
        ["--resume", ".", "--seed", "2"],
        ["paper-fig8", "--max-path", "0"],
        ["paper-fig8", "--time-limit", "-1"],
        ["paper-fig8", "--time-limit", "nan"],
        ["--max-steps", "5"],
    ],
    ids=" ".join,
)
def test_bad_limits_and_bad_resumes_end_in_two_and_one_line(arguments, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.json").write_bytes(json_bytes(config_record(TrialConfig("paper-fig8"))))
    assert main(["explore", *arguments]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("chainslam: expected ")
    assert len(said.err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["config.json"]


def test_settings_are_read_as_they_were_written(tmp_path):
    config = TrialConfig(
        "map.svg", "graph", seed=2**63, start=(1.0, 2.0), max_path_m=3.0,
        mission=MappingMissionConfig(explorer=ExplorerConfig(sweep=False), return_to_start=True),
    )  # fmt: skip
    path = tmp_path / "config.json"
    said = config_record(config)
    path.write_bytes(json_bytes(said))
    assert read_trial(path) == config
    said = json.loads(path.read_text())
    trial = said["trial"]
    wrong = {
        "trial should be an object": {**said, "trial": []},
        "no trial": {"format": FORMAT},
        "no format": {"trial": trial},
        "format 0": {**said, "format": 0},
        "trial.seed should be a whole number": {**said, "trial": {**trial, "seed": "one"}},
        "trial.errorless should be true or false": {**said, "trial": {**trial, "errorless": 1}},
        "trial.robot should be an object": {**said, "trial": {**trial, "robot": 3}},
        "the unknown key 'trial.more'": {**said, "trial": {**trial, "more": 1}},
        "no trial.world": {**said, "trial": {key: value for key, value in trial.items() if key != "world"}},
        "the unknown key 'more'": {**said, "more": 1},
        "p0 should be one of large, small, zero": {**said, "trial": {**trial, "p0": "huge"}},
    }
    for found, content in wrong.items():
        path.write_bytes(json_bytes(content))
        with pytest.raises(UsageError, match=rf"^expected .*, found .*{found}.*: .*$"):
            read_trial(path)


def interrupt_me():
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(1.0)


def test_the_first_interrupt_waits_and_the_second_does_not():
    with first_interrupt_waits() as stop_if_asked:
        stop_if_asked()
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            stop_if_asked()
        with pytest.raises(KeyboardInterrupt):
            interrupt_me()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_was_started_to_ignore_ctrl_c_goes_on_ignoring_it():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with first_interrupt_waits() as stop_if_asked:
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
            os.kill(os.getpid(), signal.SIGINT)
            stop_if_asked()
    finally:
        signal.signal(signal.SIGINT, before)


class HalfBuilt:
    """Its finalizer needs what the interrupt kept from being built, as pyparsing's does."""

    def __init__(self):
        os.kill(os.getpid(), signal.SIGINT)
        self.expr = None

    def __del__(self):
        assert self.expr is None


def test_what_an_interrupt_leaves_half_built_says_nothing(monkeypatch):
    def interrupted():
        try:
            HalfBuilt()
        except KeyboardInterrupt:
            return True

    said = []
    monkeypatch.setattr(sys, "unraisablehook", said.append)
    with nothing_half_built_speaks():
        assert interrupted()
    assert not said
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert interrupted()
    gc.collect()
    assert len(said) == 1, "as Python does"
    said.clear()


@pytest.mark.parametrize(("cause", "status"), [(KeyboardInterrupt("SIGHUP"), 130), (None, None)])
def test_an_interrupt_while_a_compiled_module_loads_is_one(monkeypatch, capsys, cause, status):
    def load(_):
        raise ImportError("initialization failed") from cause

    monkeypatch.setattr(cli, "_parse", load)
    if status is None:
        with pytest.raises(ImportError):
            main(["backends"])
    else:
        assert main(["backends"]) == status
        assert capsys.readouterr().err == "chainslam: interrupted; every file that was written is complete\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_comes_when_all_is_done_changes_no_status(number):
    code = (
        "import atexit, os, sys\n"
        "from chainslam.experiments.commands import cli\n"
        f"atexit.register(os.kill, os.getpid(), {int(number)})\n"
        "sys.argv = ['chainslam', 'strategies']\n"
        "sys.exit(cli.process())"
    )
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_second_ctrl_c_at_any_line_of_a_commands_end_changes_no_status(monkeypatch):
    """It comes, in one run after the other, at every line of ours that is run once the first has stopped the work."""
    stopped, at, lines = False, 0, 0

    def work(arguments):
        nonlocal stopped
        stopped = True
        raise KeyboardInterrupt

    def trace(frame, event, _):
        nonlocal lines
        ours = frame.f_code.co_filename.startswith(str(ROOT / "chainslam" / "experiments"))
        if stopped and ours and event == "line":
            lines += 1
            if lines == at:
                os.kill(os.getpid(), signal.SIGINT)
        return trace if ours else None

    monkeypatch.setattr(cli, "_parse", work)
    handlers = {number: signal.getsignal(number) for number in STOPS}
    tracer = sys.gettrace()
    gc.freeze()  # an interrupted command collects what it left: not all that the tests hold, each time
    while lines >= at:
        stopped, at, lines = False, at + 1, 0
        sys.settrace(trace)
        try:
            status = cli.process()
        finally:
            sys.settrace(tracer)
            for number, handler in handlers.items():
                signal.signal(number, handler)
        assert status == 130, at
    gc.unfreeze()
    assert at > 20


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_ends_in_130_and_what_is_written_is_whole(times, tmp_path):
    out = tmp_path / "run"
    command = [sys.executable, "-m", "chainslam.experiments.commands.cli", "explore", "hall", "--out", str(out)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        log = out / "log.running"
        # Some steps are done: after a fixed time a loaded machine might not have begun.
        while not log.exists() or log.stat().st_size < 20_000:
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        if times == 2:
            # By now the first has ended the mission: the second comes while it is scored and written.
            time.sleep(0.3)
            process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert (process.returncode, "Traceback" in said) == (130, False), said
    assert "interrupted" in said
    assert not list(out.glob(".*"))
    if times == 1:
        summary = json.loads((out / "summary.json").read_text())
        assert (summary["status"], summary["certificate"]["outcome"]) == ("stopped", "interrupted")
        assert summary["steps"] >= 1
        with np.load(out / "map.npz") as saved:
            # Ended between two steps: the joint covariance is that of the map beside it.
            assert np.all(np.isfinite(saved["cov"]))
        assert {"map.png", "map.svg", "map.pgm", "map.npz", "log.npz"} <= {path.name for path in out.iterdir()}
