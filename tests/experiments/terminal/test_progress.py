"""The table at the end of a run."""

import json
from pathlib import Path

import pytest

from experiments.terminal.progress import print_summary

RUN = Path(__file__).parents[2] / "data" / "format1" / "run"


@pytest.fixture
def summary():
    return json.loads((RUN / "summary.json").read_text())


def test_names_in_a_drawing_that_are_no_corners_get_no_row(summary, capsys):
    assert all(each["mapped_m"] is None for each in summary["distances"].values())
    print_summary(summary)
    assert "distance" not in capsys.readouterr().out


def test_distances_that_were_measured_have_a_row_and_the_others_are_counted(summary, capsys):
    summary["distances"] |= {"A-B": {"true_m": 6.5, "mapped_m": 6.4964, "sigma_m": 0.01}}
    print_summary(summary)
    said = " ".join(capsys.readouterr().out.split())
    assert "distance A-B │ 6.496 m (true 6.50 m)" in said
    assert f"distances not in the map │ {len(summary['distances']) - 1}" in said
