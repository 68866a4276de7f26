"""Rows of trials: each written once, whatever interrupts them."""

import json
from dataclasses import replace

import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.usage import UsageError
from studies.runner import rows
from studies.runner import trials as trial_rows
from studies.runner.trials import PARTS, one, rows_of


def trials(count, **settings):
    return [TrialConfig(f"random:{k}", **settings) for k in range(1, count + 1)]


@pytest.fixture
def instant(monkeypatch):
    """Trials that end at once, and the worlds that were run."""
    ran = []

    def run(config):
        ran.append(config.world)
        return trial_rows._settings(config)

    monkeypatch.setattr(trial_rows, "one", run)
    return ran


def test_a_study_begun_again_runs_only_what_is_missing(instant, tmp_path):
    out = tmp_path / "deep" / "rows.jsonl"
    assert len(list(rows_of(trials(3), out, 1))) == 3
    assert len(list(rows_of(trials(5), out, 1))) == 5
    assert instant == [f"random:{k}" for k in range(1, 6)]
    assert [json.loads(line)["file"] for line in out.read_text().splitlines()] == instant


def test_other_settings_and_other_code_are_other_trials(instant, tmp_path, monkeypatch):
    out = tmp_path / "rows.jsonl"
    for settings in ({}, {"errorless": True}, {"backend": "graph"}, {"p0": "zero"}, {"max_steps": 9}, {"seed": 2}):
        assert len(list(rows_of(trials(1, **settings), out, 1))) == 1
    assert len(instant) == 6
    monkeypatch.setattr(rows, "fingerprint", lambda: "another")
    assert [row["code"] for row in rows_of(trials(1), out, 1)] == ["another"]
    assert len(instant) == 7


def test_comments_and_docstrings_decide_no_trial():
    bare = "class A:\n    b: int = 1\n\n    def c(self):\n        return 'd'\n"
    told = bare.replace("class A:", '"""A."""\n# Why.\nclass A:\n    """B."""')
    told = told.replace("= 1\n", '= 1\n    """C."""\n').replace("(self):", '(self):\n        """D."""')
    assert rows.code_alone(told) == rows.code_alone(bare)
    assert rows.code_alone("class A:\n    'Words alone.'\n") == rows.code_alone("class A:\n    'Others.'\n")
    for changed in (bare.replace("1", "2"), bare.replace("'d'", "'e'"), bare.replace("int", "float")):
        assert rows.code_alone(changed) != rows.code_alone(bare)


def test_a_row_cut_short_by_a_crash_is_run_again(instant, tmp_path):
    out = tmp_path / "rows.jsonl"
    list(rows_of(trials(2), out, 1))
    out.write_bytes(out.read_bytes()[:-5])
    assert len(list(rows_of(trials(2), out, 1))) == 2
    assert instant == ["random:1", "random:2", "random:2"]
    assert all(json.loads(line) for line in out.read_text().splitlines())


@pytest.mark.parametrize("content", ["walls\n", "[1]\n", "{}\n"])
def test_a_file_of_something_else_is_told(content, tmp_path):
    (tmp_path / "rows.jsonl").write_text(content)
    with pytest.raises(UsageError, match="expected rows with file"):
        list(rows_of(trials(1), tmp_path / "rows.jsonl", 1))
    assert (tmp_path / "rows.jsonl").read_text() == content


def test_a_row_has_times_along_the_run_memory_and_survives_json():
    row = one(TrialConfig("paper-fig4", max_steps=30, errorless=True))
    assert row == json.loads(json.dumps(row))
    assert row["status"] == "stopped"
    assert len(row["step_ms_along"]) == PARTS
    assert 0.0 < row["planning_ms_mean"] < row["step_ms_mean"]
    assert 20.0 < row["peak_mib"] < 2048.0


def test_a_world_that_is_none_is_a_row():
    assert one(replace(trials(1)[0], world="nowhere.json"))["status"] == "not loaded"


def test_rows_of_other_code_count_where_that_is_asked_for(instant, tmp_path, monkeypatch):
    out = tmp_path / "rows.jsonl"
    list(rows_of(trials(2), out, 1))
    monkeypatch.setattr(rows, "fingerprint", lambda: "another")
    assert len(list(rows_of(trials(3), out, 1, any_code=True))) == 3
    assert instant == ["random:1", "random:2", "random:3"]
