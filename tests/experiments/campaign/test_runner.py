"""The final table is the same however a campaign came to its end: jobs, kill -9, resume, Dask, lost workers."""

import csv
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chainslam.experiments.campaign import work
from chainslam.experiments.campaign.comparison.tables import TIMINGS, write_tables
from chainslam.experiments.campaign.plan import Campaign, Trial, config_of, trials
from chainslam.experiments.campaign.runner import on_cores, run_campaign
from chainslam.experiments.campaign.store import opened, read_campaigns
from chainslam.experiments.campaign.work import Job, perform
from chainslam.experiments.commands.cli import main
from chainslam.slam.extraction.extract import extract
from tests.experiments.campaign.running import run

ROOT = Path(__file__).parents[3]
CAMPAIGN = Campaign(("paper-fig4",), ("block-ekf",), ("nearest-robot",), 2, max_steps=12)
WORDS = [
    "--worlds", "paper-fig4", "--backends", "block-ekf",
    "--strategies", "nearest-robot", "--trials", "2", "--max-steps", "12",
]  # fmt: skip
TABLES = ("trials", "marks", "steps")


def tables(folder):
    """Every CSV table without its timings, and the untimed Parquet tables byte for byte."""
    found = {}
    for name in TABLES:
        with (folder / f"{name}.csv").open() as file:
            rows = list(csv.reader(file))
        kept = [k for k, column in enumerate(rows[0]) if not column.startswith(TIMINGS)]
        found[name] = [[row[k] for k in kept] for row in rows]
    return found | {f"{name}.parquet": (folder / f"{name}.parquet").read_bytes() for name in ("marks", "steps")}


STRUCK = """
import os, signal, sys, time
from chainslam.experiments.commands import cli
from chainslam.experiments.campaign.store import Store

number, left, save = int(sys.argv.pop(1)), int(sys.argv.pop(1)), Store.save
# Under nohup a process is born deaf to SIGHUP.
signal.signal(signal.SIGHUP, signal.SIG_DFL)

def save_and_be_struck(store, done):
    global left
    save(store, done)
    left -= done.trial.arm != "recording"
    if not left:
        os.killpg(0, number)
        time.sleep(60.0)

Store.save = save_and_be_struck
sys.exit(cli.main())
"""
"""A campaign whose processes all get a signal once so many trials are saved: told from outside, it might be over."""


def start(folder, *more, struck=None):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    program = (
        ["-m", "chainslam.experiments.commands.cli"] if struck is None else ["-c", STRUCK, *map(str, map(int, struck))]
    )
    command = [sys.executable, *program, "compare", *WORDS, "--out", str(folder), *more]
    return subprocess.Popen(command, env=environment, start_new_session=True, stdout=subprocess.DEVNULL)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return run(tmp_path_factory.mktemp("undisturbed") / "campaign", CAMPAIGN)


def test_killed_and_resumed_it_leaves_the_same_table_and_redoes_only_what_is_missing(undisturbed, tmp_path):
    folder = tmp_path / "campaign"
    assert start(folder, "--jobs", "2", struck=(signal.SIGKILL, 2)).wait() == -signal.SIGKILL
    done = {path: path.stat().st_mtime_ns for path in folder.rglob("*.npz")}
    assert len(list(folder.rglob("trials/**/*.npz"))) == 2
    assert not (folder / "trials.csv").exists()
    (folder / "trials" / ".00001.npz.1.part").write_bytes(b"half")
    assert start(folder, "--jobs", "2").wait() == 0
    assert tables(folder) == tables(undisturbed)
    assert {path: path.stat().st_mtime_ns for path in done} == done
    assert not list(folder.rglob(".*.part"))


@pytest.mark.parametrize(
    "number", [signal.SIGINT, *(pytest.param(n, marks=pytest.mark.long) for n in (signal.SIGTERM, signal.SIGHUP))]
)
def test_interrupted_it_says_so_and_keeps_what_is_done(number, undisturbed, tmp_path):
    folder = tmp_path / "campaign"
    assert start(folder, "--jobs", "2", struck=(number, 1)).wait() == 130
    assert list(folder.rglob("trials/**/*.npz"))
    assert tables(run(folder, CAMPAIGN)) == tables(undisturbed)


def test_a_trial_that_fails_is_recorded_with_its_reason_and_the_rest_goes_on(tmp_path, monkeypatch):
    from chainslam.experiments.campaign import work

    drive = work._drive

    def broken(job):
        if job.trial.seed == 1:
            raise RuntimeError("the estimator lost its mind")
        return drive(job)

    monkeypatch.setattr(work, "_drive", broken)
    with opened(tmp_path / "campaign", replace(CAMPAIGN, max_steps=5)) as store:
        run_campaign(store, on_cores(1))
        write_tables(store.folder, store.campaign, trials(store.campaign), store.record)
        found = [store.record(trial).summary for trial in trials(store.campaign)]
    assert all(("lost its mind" in s["reason"]) == (s["seed"] == 1) for s in found)
    assert {s["status"] for s in found if s["seed"] == 1} == {"failed"}
    assert len(tables(tmp_path / "campaign")["trials"]) == 1 + len(found) == 7


def test_another_campaign_in_the_same_folder_is_refused_in_one_line(undisturbed, tmp_path, capsys):
    assert read_campaigns(undisturbed) == (CAMPAIGN,)
    files = {"other campaign": undisturbed, "no campaign": tmp_path}
    (tmp_path / "thesis.txt").write_text("mine")
    for folder in files.values():
        words = [word if word != "12" else "13" for word in WORDS]
        assert main(["compare", *words, "--out", str(folder)]) == 2
        said = capsys.readouterr().err.strip()
        assert said.startswith("chainslam: expected")
        assert "\n" not in said


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (["--trials", "3"], ("--first-seed 3", "--merge")), (["--backends", "full-ekf"], ("--merge",)),
        (["--max-steps", "13"], ("name another --out",)),
    ],
)  # fmt: skip
def test_a_folder_of_another_campaign_is_refused_with_the_way_to_extend_it(
    changed, words, undisturbed, tmp_path, capsys
):
    assert main(["compare", *WORDS, *changed, "--out", str(undisturbed)]) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in words)
    assert ("--merge" in said) == ("--merge" in words)


def test_the_trials_announced_are_those_that_are_run(tmp_path, capsys):
    words = [*WORDS, "--modes", "replay", "--association", "own", "--jobs", "1", "--out", str(tmp_path / "campaign")]
    assert main(["compare", *words]) == 0
    said = capsys.readouterr().out
    assert "4 trials, 2 of them recordings for the replays;" in said
    assert "4 trials in " in said


@pytest.mark.parametrize(
    "change",
    [
        ["--worlds", "nowhere"],
        ["--backends", "magic"],
        ["--strategies", "magic"],
        ["--trials", "0"],
        ["--trials", "-1"],
        ["--trials", "1000000000000"],
        ["--trials", "9" * 5000],
        ["--jobs", "1000000"],
        ["--first-seed", "-1"],
        ["--driver", "magic"],
        ["--jobs", "0"],
        ["--modes", "open"],
        ["--backends", "full-ekf", "full-ekf"],
        ["--dask", "127.0.0.1:9"],
        ["--preset", "magic"],
    ],
    ids=lambda c: "".join(c[:2])[:40],
)
def test_bad_words_get_one_line_and_status_2(change, tmp_path, capsys):
    words = dict.fromkeys(["--worlds", "--backends", "--strategies", "--trials"])
    words |= {"--worlds": ["paper-fig4"], "--backends": ["full-ekf"], "--strategies": ["nearest-robot"]}
    words |= {"--trials": ["1"], change[0]: change[1:]}
    arguments = [word for name, values in words.items() for word in (name, *values)]
    assert main(["compare", *arguments, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip()
    assert said.startswith("chainslam: ")
    assert "\n" not in said
    assert not (tmp_path / "out").exists()


def test_replays_of_one_recording_extract_each_scan_once_and_see_what_extraction_finds():
    trial = Trial("paper-fig4", "nearest-robot", "block-ekf", "closed", 1)
    config = config_of(CAMPAIGN, trial)
    log = perform(Job(trial, config, keep_log=True)).log
    run = work._recording(log, config)
    scans = [run.recording.scan(k) for k in range(len(run.recording))]
    extracted, rules = work.remembered(log), config.mission.mapper.extraction
    assert len({scan.time_s for scan in scans}) == len(scans)
    for scan in scans:
        assert extracted(scan, rules) is extracted(scan, rules)
        np.testing.assert_array_equal(extracted(scan, rules).lines, extract(scan, rules).lines)
        with pytest.raises(ValueError, match="read-only"):
            extracted(scan, rules).lines[0] = 0.0
