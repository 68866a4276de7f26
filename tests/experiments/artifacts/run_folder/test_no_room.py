"""Folders that vanish, disks that are full, output that nobody takes: one line, and what can be kept is."""

import os
import resource
import subprocess
import sys

import pytest

from chainslam.experiments.artifacts.running_log import RunningLog, read_running
from chainslam.experiments.commands.cli import main
from tests.experiments.artifacts.run_folder.striking import ROOT, WORDS
from tests.experiments.commands.test_control import timeless

FULL = (
    "chainslam: expected to write to standard output, found [Errno 28] No space left on device: the files were written"
    " nevertheless"
)


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
    assert said.startswith(f"chainslam: expected the folder {folder} to stay until the end, found it removed")
    assert not folder.exists()


def test_a_campaign_whose_folder_vanishes_is_one_line_and_status_1(tmp_path, capsys, monkeypatch):
    from chainslam.experiments.campaign.store import Store

    folder, save = tmp_path / "campaign", Store.save

    def lose_and_save(store, done):
        gone(folder, done)
        save(store, done)

    monkeypatch.setattr(Store, "save", lose_and_save)
    words = ["--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot", "--trials", "1"]
    assert main(["compare", *words, "--max-steps", "2", "--jobs", "1", "--out", str(folder)]) == 1
    (said,) = capsys.readouterr().err.splitlines()
    assert "found it removed" in said
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
    command = [
        sys.executable,
        "-m",
        "chainslam.experiments.commands.cli",
        *WORDS,
        "--max-steps",
        "8",
        "--out",
        str(folder),
    ]
    ended = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=write, stderr=subprocess.PIPE, text=True
    )
    os.close(write)
    assert (ended.returncode, ended.stderr.splitlines()) == (status, lines)
    assert timeless(folder) == timeless(whole)
