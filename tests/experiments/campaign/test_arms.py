"""Each arm of a campaign is what its name says: who drives, and whose matches a replay uses."""

import csv
import json
from dataclasses import replace

from chainslam.experiments.campaign.plan import ARMS, Campaign, Trial, config_of
from chainslam.experiments.campaign.work import Job, perform, unpack
from chainslam.experiments.commands.cli import main
from chainslam.experiments.replays import replay as replays
from chainslam.slam.association.matching import match
from chainslam.slam.association.methods import METHODS

CAMPAIGN = Campaign(("paper-fig4",), ("block-ekf",), ("nearest-robot",), 1, max_steps=12)
DRIVE = Trial("paper-fig4", "nearest-robot", "", "recording", 2)


def test_each_arm_uses_the_matches_that_its_name_tells(monkeypatch):
    calls = []

    def gate(*known, **more):
        calls.append(more)
        return match(*known, **more)

    monkeypatch.setattr(replays, "METHODS", {"joint": replace(METHODS["joint"], matcher=gate)})
    log = perform(Job(DRIVE, config_of(CAMPAIGN, DRIVE), keep_log=True)).log
    assert not calls
    found = {}
    for arm in ARMS:
        trial = Trial("paper-fig4", "nearest-robot", "block-ekf", arm, 2)
        config = config_of(CAMPAIGN, DRIVE if trial.association else trial)
        calls.clear()
        record = unpack(perform(Job(trial, config, log)).record, trial)
        found[arm] = (record.summary["mode"], record.summary["association"], bool(calls))
        assert (record.summary["backend"], record.summary["steps"]) == ("block-ekf", 12)
        # Innovations are taken where the truth tells the pairs: a gate of its own would cut off their tail.
        assert (record.summary["nis_mean"] is not None) == (arm == "replay-true")
    assert found == {
        "closed": ("closed", "own", False), "replay-own": ("replay", "own", True),
        "replay-true": ("replay", "true", False),
    }  # fmt: skip
    # A closed loop matches by itself, not through a replay; what a replay plays is its driver's, not its own.
    assert config_of(CAMPAIGN, DRIVE).backend == "full-ekf"


def test_a_campaign_without_noise_says_that_it_ends_and_claims_nothing_of_consistency(tmp_path, capsys):
    words = ["--worlds", "paper-fig4", "--backends", "block-ekf", "full-ekf", "--strategies", "nearest-robot"]
    words += ["--trials", "1", "--max-steps", "5", "--modes", "closed", "--errorless", "--jobs", "1"]
    assert main(["compare", *words, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "full-ekf completes 0 of 1 runs" in said
    assert "not positive definite" not in said
    comparison = json.loads((tmp_path / "comparison.json").read_text())
    assert comparison["findings"] == []
    (summary,) = {row["pose_anees"] for row in csv.DictReader((tmp_path / "trials.csv").read_text().splitlines())}
    assert summary == ""
    assert main(["report", str(tmp_path)]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "Without noise, block-ekf completes 0 of 1 runs" in page
    assert "What does inconsistency cost?" not in page
