"""A real robot's log without a back end: mapped from all scans at once, and as far as there are scans when stopped."""

import json
import os
import signal
from contextlib import contextmanager

import numpy as np
import pytest

import chainslam
from chainslam.experiments.commands import replay
from chainslam.experiments.commands.cli import main
from tests.experiments.replays.test_real_log import MADE, ROOM, drive, write_log

WITHOUT_BACKEND = MADE - {"visibility.json", "visibility.png"} | {"trajectory_smoothed.tum"}


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    folder = tmp_path_factory.mktemp("offline")
    log = write_log(folder / "room.log")
    assert main(["replay", str(log), "--out", str(folder / "out")]) == 0
    return folder


def summary_in(folder):
    return json.loads((folder / "summary.json").read_text())


def walls_of(folder):
    """(alpha rad, d m) of the walls about the first pose, whose place in the room is known."""
    with np.load(folder / "map.npz") as arrays:
        return arrays["lines_world"]


def test_without_a_back_end_a_log_leaves_the_files_of_a_replay_and_both_paths_are_the_refined_one(mapped):
    out = mapped / "out"
    assert {path.name for path in out.iterdir()} == WITHOUT_BACKEND
    assert (out / "trajectory_estimated.tum").read_bytes() == (out / "trajectory_smoothed.tum").read_bytes()
    path, (true, _) = np.loadtxt(out / "trajectory_estimated.tum"), drive(drift=0.0)
    assert np.hypot(*(path[:, 1:3] - (true - true[0])[:, :2]).T).max() < 0.02
    steps = np.genfromtxt(out / "steps.csv", delimiter=",", names=True)
    assert np.all(steps["cov_xx"] > 0.0)
    assert np.all(steps["lines"] == summary_in(out)["lines"])


def test_its_map_is_the_room_and_its_summary_has_the_keys_of_any_replay(mapped, tmp_path):
    lines = walls_of(mapped / "out")
    sides = {0.0: ROOM[0] - 1.0, np.pi / 2: ROOM[1] - 1.5}
    for alpha, r in sides.items():
        off = np.abs(lines - [alpha, r])
        assert np.any((off[:, 0] < 0.01) & (off[:, 1] < 0.02))
    words = ["replay", str(mapped / "room.log"), "--backend", "full-ekf", "--second-looks", "--out", str(tmp_path)]
    assert main(words) == 0
    ours, theirs = summary_in(mapped / "out"), summary_in(tmp_path)
    assert ours.keys() == theirs.keys()
    assert (ours["backend"], ours["status"], ours["nis"]) == ("offline", "complete", None)
    assert ours["lines"] == ours["second_looks"]["lines"] == theirs["second_looks"]["lines"]
    for name in ("map.npz", "trajectory_smoothed.tum"):
        assert (mapped / "out" / name).read_bytes() == (tmp_path / name).read_bytes()


def test_its_report_names_the_command_and_python_does_the_same(mapped, tmp_path):
    assert main(["report", str(mapped / "out")]) == 0
    page = (mapped / "out" / "report.html").read_text()
    assert "chainslam replay room.log --every 1 --odometry scans --out DIR" in page
    run = chainslam.replay(mapped / "room.log", out=tmp_path)
    assert (run.folder / "map.npz").read_bytes() == (mapped / "out" / "map.npz").read_bytes()


def test_offline_is_no_back_end_that_one_could_name(mapped, tmp_path, capsys):
    for words in (["replay", str(mapped / "room.log")], ["explore", "rooms"]):
        assert main([*words, "--backend", "offline", "--out", str(tmp_path / "out")]) == 2
        assert "expected a back end from" in capsys.readouterr().err


@pytest.mark.parametrize(("stage", "scans"), [("progress", 6), ("share_of", 10)])
def test_sigterm_keeps_the_map_of_the_scans_so_far(stage, scans, tmp_path, monkeypatch, capsys):
    calls = []

    @contextmanager
    def shown(*_):
        def show(_):
            calls.append(1)
            if len(calls) == (6 if stage == "progress" else 1):
                os.kill(os.getpid(), signal.SIGTERM)

        yield show

    monkeypatch.setattr(replay, stage, shown)
    log = write_log(tmp_path / "room.log")
    assert main(["replay", str(log), "--out", str(tmp_path / "out")]) == 130
    summary = summary_in(tmp_path / "out")
    assert (summary["status"], summary["outcome"], summary["steps"]) == ("stopped", "interrupted", scans)
    where = " during offline refinement" if stage == "share_of" else ""
    assert summary["reason"] == f"interrupted by SIGTERM{where}"
    assert summary["lines"] >= 2
    assert len(walls_of(tmp_path / "out")) == summary["lines"]
    assert scans <= len(np.loadtxt(tmp_path / "out" / "trajectory_estimated.tum")) <= 24
    assert "Traceback" not in capsys.readouterr().err


def test_sigterm_while_files_are_written_waits_for_them(tmp_path, monkeypatch):
    written = replay.write_results

    def interrupted(*given):
        os.kill(os.getpid(), signal.SIGTERM)
        return written(*given)

    monkeypatch.setattr(replay, "write_results", interrupted)
    log = write_log(tmp_path / "room.log")
    assert main(["replay", str(log), "--out", str(tmp_path / "out")]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == WITHOUT_BACKEND
