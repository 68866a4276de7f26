"""A complete run without an ANEES is in no mean of it, and every table says so."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.tables import write_tables
from chainslam.experiments.campaign.pages.campaign_page import campaign_page
from chainslam.experiments.campaign.plan import Campaign, trials
from chainslam.experiments.campaign.store import opened
from chainslam.experiments.campaign.work import Done, pack
from chainslam.viz.reports.report import html, latex
from studies.exploration.suite import table
from tests.experiments.campaign.running import run

CAMPAIGN = Campaign(("paper-fig4",), ("block-ekf", "full-ekf"), ("nearest-robot",), 3, arms=("closed",), max_steps=4)


def lacking(record, trial):
    """The trial as one that completed, without its ANEES where its covariance is said to have been no good."""
    summary = record.summary | {"status": "complete"}
    if (trial.backend, trial.seed) != ("full-ekf", 2):
        return replace(record, summary=summary)
    summary |= {"pose_anees": None, "pose_anees_from_start": None, "map_anees": None}
    summary["marks"]["end"] |= {"map_anees": None, "pose_anees_so_far": None}
    nees = record.arrays["pose_nees"].copy()
    nees[1] = np.nan
    return replace(record, summary=summary, arrays=record.arrays | {"pose_nees": nees})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A campaign of three runs a back end, all complete; one of the full EKF has a covariance that is no good."""
    folder = run(tmp_path_factory.mktemp("lacking") / "campaign", CAMPAIGN)
    with opened(folder, CAMPAIGN) as store:
        for trial in trials(CAMPAIGN):
            store.save(Done(trial, pack(lacking(store.record(trial), trial))))
        write_tables(folder, CAMPAIGN, trials(CAMPAIGN), store.record)
    return folder


def test_the_comparison_counts_it_beside_the_means(folder):
    said = json.loads((folder / "comparison.json").read_text())
    for rows in (said["pooled"], said["cells"]):
        counts = {row["backend"]: row["without"] for row in rows}
        assert {counts["full-ekf"][name] for name in ("pose_anees", "pose_anees_from_start", "map_anees")} == {1}
        assert set(counts["block-ekf"].values()) == {0}
        assert {row["backend"]: row["map_anees"]["runs"] for row in rows} == {"block-ekf": 3, "full-ekf": 2}
    at_end = {row["backend"]: row["without"] for row in said["marks"] if row["metres"] == "end"}
    assert (at_end["full-ekf"]["map_anees"], at_end["block-ekf"]["map_anees"]) == (1, 0)
    (anees,) = [row for row in said["backends"] if row["measure"] == "map_anees"]
    assert (anees["runs"], anees["pairs_without_value"]) == (2, 1)
    with (folder / "steps.csv").open() as file:
        missing = [(row["backend"], row["step"], row["without_nees"]) for row in csv.DictReader(file)]
    assert [row for row in missing if row[2] != "0"] == [("full-ekf", "1", "1")]


def test_the_report_counts_it_as_a_page_and_as_latex(folder):
    page = campaign_page(folder)
    errors = page.tables["errors closed"]
    counts = {row[0]: dict(zip(errors.header, row, strict=True)) for row in errors.rows}
    for name in ("no pose ANEES", "no map ANEES"):
        assert {backend: cells[name] for backend, cells in counts.items()} == {"block-ekf": "0", "full-ekf": "1"}
    assert {cells["no wall error"] for cells in counts.values()} == {"0"}
    compared = page.tables["differences"]
    left = {row[2]: dict(zip(compared.header, row, strict=True))["left out"] for row in compared.rows}
    assert (left["pose ANEES"], left["wall error"]) == ("1", "0")
    assert page.told["without"] == {"pose ANEES": 1, "map ANEES": 1, "wall error": 0}
    shown = re.sub(r"\s+", " ", html(page).decode())
    assert "1 of 6 scored runs have no pose ANEES" in shown
    assert "have no wall error" not in shown
    assert b"no pose ANEES" in latex(page.all_tables)


def test_the_suite_says_so_in_its_table():
    plain = {"status": "complete", "coverage": 1.0, "contours_closed": 1, "contours_reachable": 1, "world": "w"}
    plain |= dict.fromkeys(("false_matches", "duplicate_lines", "collisions"), 0) | {"errorless": False}
    rows = [plain | {"pose_anees": 1.0, "map_anees": value} for value in (2.0, None, 4.0)]
    shown = table([*rows, plain | {"errorless": True, "map_anees": None, "pose_anees": None}], by_world=False)
    cells = {str(column.header): list(column.cells) for column in shown.columns}
    assert cells["map ANEES"] == ["3.00"]
    assert cells["without: pose, map"] == ["0, 1"]
