"""Two campaigns held against each other: the same ones agree, others differ by what was put into them."""

import csv
import json
import re
from dataclasses import replace
from shutil import copytree

import pytest

from chainslam.experiments.campaign.contrast import contrast
from chainslam.experiments.campaign.pages.contrast_page import lines_of_contrast
from chainslam.experiments.campaign.pages.tables import differences
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
    assert capsys.readouterr().out.startswith("0 of 3 shared trials differ")
    said = json.loads((out / "contrast.json").read_text())
    assert said["trials"] == {"shared": 3, "the_same": 3, "different": 0, "only_first": 0, "only_second": 0}
    assert main(["report", str(out)]) == 0
    assert "0 of 3 shared trials differ" in (out / "report.html").read_text()


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
    assert "3 of 3 shared trials differ" in page
    assert "0 of 0 means differ" in page, "two runs decide nothing"
    told = [re.sub("<.*?>", "", cell) for cell in re.findall("<td.*?</td>", page)]
    at = told.index("failed")
    assert told[at - 1 : at + 2] == ["complete", "failed", "1"]


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


def test_only_means_of_ten_runs_are_tested():
    clear = {"value": 1.00031, "runs": 12, "p_holm": 0.01}
    chance, few = clear | {"p_holm": 0.2}, {"value": 9.0, "runs": 2, "p_holm": None}
    trials = {"shared": 12, "different": 5, "only_first": 1, "only_second": 2}
    lines = lines_of_contrast({"trials": trials, "differences": [clear, chance, few, few | {"value": None}]})
    assert [re.findall(r"\d+", line)[:4] for line in lines] == [["5", "12", "1", "2"], ["1", "2", "0", "05"]]
    assert lines[1].endswith("too few runs for 1.")


def test_a_small_change_is_told_with_digits_enough():
    row = {"backend": "graph", "arm": "closed", "measure": "ate_m", "kind": "ratio", "value": 1.00031, "low": 1.00012,
           "high": 1.00052, "runs": 12, "effect_size": 1.0, "p_holm": 0.01, "pairs_without_value": 0}  # fmt: skip
    table = differences("Means", [row, row | {"value": None}], {"estimator": "backend"})
    (cells,) = table.rows
    assert dict(zip(table.header, cells, strict=True))["value"] == "1.0003"
    assert dict(zip(table.header, cells, strict=True))["95 % interval"] == "1.0001 to 1.0005"
