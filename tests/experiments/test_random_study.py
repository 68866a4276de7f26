"""A robot in random buildings: a sample of what `make random` runs in full, and the study's own bookkeeping."""

import json

import pytest

from experiments import random_study
from experiments.random_study import RandomStudy, faults, run
from experiments.scenario import TrialConfig, UsageError
from experiments.trial import run_trial

SMALL = (22, 60, 65, 123, 214, 277)
"""Seeds of buildings with little floor, hence quick to explore."""
CLEAN = {"status": "complete", "reason": "", "collisions": 0, "coverage": 1.0}
CLEAN |= {"contours_closed": 1, "contours_reachable": 1}


@pytest.mark.usefixtures("_unchecked")
@pytest.mark.parametrize("seed", SMALL)
def test_a_random_building_is_explored_whole_without_a_touch(seed):
    assert faults(run_trial(TrialConfig(f"random:{seed}", errorless=True, max_steps=5000)).summary) == []


@pytest.fixture
def instant(monkeypatch):
    """Trials that end at once, and the worlds that were run."""
    ran = []

    def results(trials, jobs):
        for index, trial in enumerate(trials):
            ran.append(trial.world)
            yield index, {"file": trial.world, "seed": trial.seed, "world": trial.world, **CLEAN}

    monkeypatch.setattr(random_study, "results", results)
    return ran


def test_a_study_begun_again_runs_only_what_is_missing(instant, tmp_path):
    out = tmp_path / "deep" / "rows.jsonl"
    assert len(list(run(RandomStudy(3, out=out)))) == 3
    assert len(list(run(RandomStudy(5, out=out)))) == 5
    assert instant == [f"random:{k}" for k in range(1, 6)]
    assert [json.loads(line)["file"] for line in out.read_text().splitlines()] == instant


def test_runs_of_another_back_end_or_with_noise_are_other_runs(instant, tmp_path):
    out = tmp_path / "rows.jsonl"
    for study in (
        RandomStudy(1, out=out),
        RandomStudy(1, out=out, noise=True),
        RandomStudy(1, out=out, backend="graph"),
    ):
        assert len(list(run(study))) == 1
    assert len(instant) == 3


def test_a_row_cut_short_by_a_crash_is_run_again(instant, tmp_path):
    out = tmp_path / "rows.jsonl"
    list(run(RandomStudy(2, out=out)))
    out.write_bytes(out.read_bytes()[:-5])
    assert len(list(run(RandomStudy(2, out=out)))) == 2
    assert instant == ["random:1", "random:2", "random:2"]
    assert all(json.loads(line) for line in out.read_text().splitlines())


@pytest.mark.parametrize("content", ["walls\n", "[1]\n", "{}\n"])
def test_a_file_of_something_else_is_told(content, tmp_path):
    (tmp_path / "rows.jsonl").write_text(content)
    with pytest.raises(UsageError, match="expected rows of this study"):
        list(run(RandomStudy(1, out=tmp_path / "rows.jsonl")))
    assert (tmp_path / "rows.jsonl").read_text() == content


@pytest.mark.parametrize(
    "change",
    [
        {"status": "stopped"},
        {"status": "failed", "coverage": None},
        {"collisions": 1},
        {"coverage": 0.97},
        {"contours_closed": 0},
    ],
)
def test_whatever_is_not_clean_is_named(change):
    assert faults(CLEAN) == []
    assert len(faults(CLEAN | change)) == 1
