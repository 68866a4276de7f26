"""Two campaigns held against each other: the same ones agree, others differ by what was put into them."""

import csv
import json
from dataclasses import replace
from shutil import copytree

import pytest

from chainslam.experiments.campaign.contrast import contrast
from chainslam.experiments.campaign.pages.contrast_page import verdict
from chainslam.experiments.campaign.plan import Campaign, trials
from chainslam.experiments.campaign.store import opened
from chainslam.experiments.campaign.work import Done, pack
from chainslam.experiments.commands.cli import main
from chainslam.experiments.usage import UsageError
from tests.experiments.campaign.running import run

CAMPAIGN = Campaign(("paper-fig4",), ("full-ekf",), ("nearest-robot",), 3, arms=("closed",), max_steps=6)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    return run(tmp_path_factory.mktemp("contrast") / "first", CAMPAIGN)


def other(first, folder, change):
    """The same campaign with another outcome: `change` alters the summary of each trial."""
    copytree(first, folder)
    with opened(folder, CAMPAIGN) as store:
        for trial in trials(CAMPAIGN):
            record = store.record(trial)
            record = replace(record, summary=record.summary | change(trial, record.summary))
            store.save(Done(trial, pack(record)))
    return folder


def test_a_campaign_is_the_same_as_itself_even_if_a_later_version_keeps_more(first, tmp_path, capsys):
    second = other(first, tmp_path / "second", lambda trial, summary: {"something_new": 1.0})
    out = tmp_path / "out"
    assert main(["compare", "--against", str(first), str(second), "--out", str(out)]) == 0
    assert "No: all 3 trials that both have came out the same" in capsys.readouterr().out
    said = json.loads((out / "contrast.json").read_text())
    assert said["trials"] == {"shared": 3, "the_same": 3, "different": 0, "only_first": 0, "only_second": 0}
    assert main(["report", str(out)]) == 0
    assert "came out the same" in (out / "report.html").read_text()


def test_what_was_made_worse_is_found_with_its_size(first, tmp_path):
    def worse(trial, summary):
        if trial.seed == 3:
            return {"status": "failed"}
        return {"status": "complete", "pose_anees": 2.0 * summary["pose_anees"]}

    better = other(first, tmp_path / "better", lambda trial, summary: {"status": "complete"})
    contrast(better, other(first, tmp_path / "worse", worse), tmp_path / "out")
    said = json.loads((tmp_path / "out" / "contrast.json").read_text())
    assert said["trials"]["different"] == 3
    assert said["status"] == {"complete -> complete": 2, "complete -> failed": 1}
    (anees,) = [row for row in said["differences"] if row["measure"] == "pose_anees"]
    assert anees["value"] == pytest.approx(2.0)
    assert anees["low"] is None, "two runs make no interval"
    assert anees["runs"] == 2
    assert anees["pairs_without_value"] == 1
    with (tmp_path / "out" / "contrast.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["seed"] for row in rows] == ["1", "2", "3"]
    assert rows[2]["status_second"] == "failed"
    assert float(rows[0]["pose_anees_second"]) == pytest.approx(2.0 * float(rows[0]["pose_anees_first"]))
    assert main(["report", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Yes: 3 of 3 trials" in page
    assert "means of fewer than 10 runs cannot be told from chance" in page
    assert "changed by more than chance" not in page
    assert "1 went complete -&gt; failed" in page


def test_only_shared_trials_are_compared_and_settings_that_differ_are_told(first, tmp_path):
    later = run(tmp_path / "later", replace(CAMPAIGN, trials=2, first_seed=3, max_steps=7))
    contrast(first, later, tmp_path / "out")
    said = json.loads((tmp_path / "out" / "contrast.json").read_text())
    assert said["trials"] == {"shared": 1, "the_same": 0, "different": 1, "only_first": 2, "only_second": 1}
    assert said["settings"]["max_steps"] == [6, 7]


def test_campaigns_that_share_nothing_get_one_line(first, tmp_path, capsys):
    apart = run(tmp_path / "apart", replace(CAMPAIGN, trials=1, first_seed=9))
    with pytest.raises(UsageError, match="share trials"):
        contrast(first, apart, tmp_path / "out")
    words = ["compare", "--against", str(first), str(apart), "--merge", str(first), "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert "found both" in capsys.readouterr().err


def said_of(*rows):
    trials = {"shared": 12, "different": 12, "the_same": 0}
    same = {"backend": "graph", "mode": "closed", "association": None, "measure": "ate_m", "kind": "ratio"}
    return {"trials": trials, "differences": [same | row for row in rows]}


def test_a_small_change_of_many_runs_is_told_with_digits_enough_and_one_of_few_is_none():
    small = {"value": 1.00031, "low": 1.00012, "high": 1.00052, "runs": 12, "effect_size": 1.0, "p_holm": 0.01}
    few = {"value": 9.0, "low": 8.0, "high": 10.0, "runs": 2, "effect_size": 5.0, "p_holm": None}
    words = verdict(said_of(small, few))
    assert "Of 1 means, 1 changed by more than chance" in words[0]
    assert "1 means of fewer than 10 runs" in words[0]
    assert words[1:] == ("graph, closed loop, error of the path: 1.0003 (1.0001 to 1.0005), ratio.",)
    assert len(verdict(said_of(few))) == 1
