"""The table at the end of a run."""

import json

import pytest

from chainslam.experiments.commands.cli import main
from chainslam.experiments.terminal.progress import bar_of, duration, print_summary, total_of


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    folder = tmp_path_factory.mktemp("told") / "run"
    assert main(["explore", "paper-fig8", "--max-steps", "3", "--out", str(folder)]) == 0
    return (folder / "summary.json").read_text()


@pytest.fixture
def summary(told, capsys):
    capsys.readouterr()
    return json.loads(told)


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


def test_both_clocks_are_told_apart_by_name(summary, capsys):
    print_summary(summary)
    said = capsys.readouterr().out
    assert "driving time" in said
    assert "computing time of a step" in said


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.04, "0.0 s"), (9.94, "9.9 s"), (59.4, "59 s"), (59.6, "1 min 0 s"), (3661.0, "1 h 1 min")],
)
def test_a_duration_has_two_units_at_most(seconds, words):
    assert duration(seconds) == words


def test_progress_tells_what_is_left_on_a_terminal_and_nothing_elsewhere(capsys, monkeypatch):
    with bar_of("trials", 4.0) as (bar, task):
        bar.advance(task)
    assert capsys.readouterr().err == ""
    monkeypatch.setenv("FORCE_COLOR", "1")
    with bar_of("trials", 4.0) as (bar, task):
        bar.advance(task)
        bar.refresh()
    told = capsys.readouterr().err
    assert "computing" in told
    assert "left" in told
    with bar_of("figures", None):
        pass
    assert "left" not in capsys.readouterr().err


def test_a_run_longer_than_expected_never_fills_its_bar():
    assert [done / total_of(10.0, done) for done in (1, 9, 20)] == pytest.approx([0.1, 0.9, 0.95])
    assert total_of(None, 3) is None
