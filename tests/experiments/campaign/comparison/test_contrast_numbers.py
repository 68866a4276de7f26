"""Every number of contrast.json, of two campaigns whose results were made by hand."""

import csv
import json
from dataclasses import replace

import pytest

from chainslam.experiments.campaign.comparison.comparison import MEASURES
from chainslam.experiments.campaign.contrast import COMPARED, NAMES, contrast, read_contrast
from chainslam.experiments.campaign.plan import Campaign, trials
from chainslam.experiments.campaign.scores.score import TrialScores
from chainslam.experiments.campaign.store import opened
from chainslam.experiments.campaign.work import Done, pack
from chainslam.experiments.scoring import statistics
from chainslam.experiments.usage import UsageError

BACKENDS, ARMS = ("block-ekf", "full-ekf"), ("closed", "replay-true")
CAMPAIGN = Campaign(("paper-fig4",), BACKENDS, ("nearest-robot",), 3, arms=ARMS, max_steps=6)
TIMES = {("block-ekf", "closed"): 2.0, ("full-ekf", "closed"): 0.5, ("block-ekf", "replay-true"): 3.0,
         ("full-ekf", "replay-true"): 1.0}  # fmt: skip
"""What the second campaign's errors are, in the first one's."""


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    """Resample little: intervals are for test_statistics.py to judge."""
    monkeypatch.setattr(statistics, "DRAWS", 100)


def made(folder, times, campaign=CAMPAIGN, without=()):
    """A campaign in a folder, with these errors; some of its trials have no result yet."""
    with opened(folder, campaign) as store:
        for trial in trials(campaign):
            if trial.seed in without:
                continue
            error = 0.01 * trial.seed * times[trial.backend, trial.arm]
            summary = {
                "world": trial.world, "backend": trial.backend, "strategy": trial.strategy, "seed": trial.seed,
                "mode": "closed" if trial.arm == "closed" else "replay", "association": trial.association or "own",
                "status": "stopped" if (times is TIMES and trial.seed == 3) else "complete", "reason": "by hand",
                "steps": 10 * trial.seed, "path_length_m": 5.0, "coverage": 0.9, "wall_rmse_m": error,
                "matches_true": 5, "matches_missed": 1, "matches_false": 0, "duplicate_lines": trial.seed, "merges": 1,
                "false_merges": 0, "step_ms": {"mean": 3.0 + error},
            }  # fmt: skip
            store.save(Done(trial, pack(TrialScores(summary, {}))))
    return folder


SAME = dict.fromkeys(TIMES, 1.0)


@pytest.fixture
def said(tmp_path):
    contrast(made(tmp_path / "one", SAME), made(tmp_path / "two", TIMES), tmp_path / "out")
    return read_contrast(tmp_path / "out")


def test_each_measure_is_compared_for_each_back_end_in_each_arm_second_over_first(said):
    rows = {(r["backend"], r["mode"], r["association"], r["measure"]): r for r in said["differences"]}
    assert len(rows) == len(said["differences"]) == 4 * len(MEASURES)
    for (backend, arm), times in TIMES.items():
        mode, association = ("closed", "own") if arm == "closed" else ("replay", "true")
        row = rows[backend, mode, association, "wall_rmse_m"]
        # The third run of the second campaign was stopped: it has an error, but its path is no whole one.
        assert (row["runs"], row["pairs_without_value"]) == (3, 0)
        path = rows[backend, mode, association, "path_length_m"]
        assert (path["runs"], path["pairs_without_value"], path["first_better"]) == (2, 1, pytest.approx(1 / 3))
        assert row["value"] == pytest.approx(times)
        # Three runs make no interval, and nothing is tested.
        assert row["low"] is row["high"] is row["p_holm"] is None
        assert row["first_better"] == (times < 1.0) + 0.5 * (times == 1.0)
        assert rows[backend, mode, association, "duplicate_lines"]["value"] == 0.0
        assert rows[backend, mode, association, "ate_m"]["value"] is None


def test_trials_are_counted_and_their_ends_told(said):
    assert said["trials"] == {"shared": 12, "the_same": 2, "different": 10, "only_first": 0, "only_second": 0}
    assert said["status"] == {"complete -> complete": 8, "complete -> stopped": 4}
    assert said["settings"] == {}


def test_each_trial_that_differs_is_told_with_both_its_values(said, tmp_path):
    assert len(said["different_trials"]) == 10
    row = next(
        r for r in said["different_trials"] if (r["backend"], r["mode"], r["seed"]) == ("block-ekf", "replay", 3)
    )
    assert {key: row[key] for key in NAMES} == {
        "world": "paper-fig4", "strategy": "nearest-robot", "backend": "block-ekf", "mode": "replay",
        "association": "true", "seed": 3,
    }  # fmt: skip
    assert (row["status_first"], row["status_second"]) == ("complete", "stopped")
    assert (row["wall_rmse_m_first"], row["wall_rmse_m_second"]) == pytest.approx((0.03, 0.09))
    assert (row["steps_first"], row["coverage_second"], row["ate_m_first"]) == (30, 0.9, None)
    columns = [f"{name}_{side}" for name in COMPARED for side in ("first", "second")]
    assert list(row) == [*NAMES, *dict.fromkeys(columns)]
    with (tmp_path / "out" / "contrast.csv").open() as file:
        table = list(csv.DictReader(file))
    assert list(table[0]) == list(row)
    assert [r["seed"] for r in table] == [str(r["seed"]) for r in said["different_trials"]]
    assert {r["backend"] for r in table if r["mode"] == "replay"} == set(BACKENDS)


def test_the_same_campaign_twice_is_the_same_whatever_its_times(tmp_path):
    one, two = (made(tmp_path / name, SAME) for name in ("one", "two"))
    contrast(one, two, tmp_path / "out")
    said = read_contrast(tmp_path / "out")
    assert said["trials"] == {"shared": 12, "the_same": 12, "different": 0, "only_first": 0, "only_second": 0}
    assert said["different_trials"] == []
    assert (said["first"], said["second"]) == (str(one), str(two))
    assert (tmp_path / "out" / "contrast.csv").read_text().split() == [",".join(NAMES)]


def test_only_trials_that_both_have_are_compared_and_other_settings_are_told(tmp_path):
    one = made(tmp_path / "one", SAME, without=(1,))
    later = replace(CAMPAIGN, trials=2, first_seed=3, max_steps=7, p0="large", driver="block-ekf")
    two = made(tmp_path / "two", SAME, later)
    contrast(one, two, tmp_path / "out")
    said = read_contrast(tmp_path / "out")
    assert said["trials"] == {"shared": 4, "the_same": 4, "different": 0, "only_first": 4, "only_second": 4}
    assert said["settings"] == {
        "driver": ["full-ekf", "block-ekf"], "max_steps": [6, 7], "p0": ["small", "large"]
    }  # fmt: skip
    assert list(said["settings"]) == ["driver", "max_steps", "p0"]


def test_versions_and_commits_that_differ_are_told(tmp_path):
    one, two = (made(tmp_path / name, SAME) for name in ("one", "two"))
    config = json.loads((two / "config.json").read_text())
    config["commit"], config["versions"]["numpy"], config["versions"]["new"] = "another", "9.9", "1.0"
    gone = config["versions"].pop("scipy")
    (two / "config.json").write_text(json.dumps(config))
    contrast(one, two, tmp_path / "out")
    settings = read_contrast(tmp_path / "out")["settings"]
    assert list(settings) == ["commit", "new", "numpy", "scipy"]
    assert settings["scipy"] == [gone, None]
    assert (settings["commit"][1], settings["new"], settings["numpy"][1]) == ("another", [None, "1.0"], "9.9")


def test_a_world_that_only_one_of_them_has_is_no_world_that_differs(tmp_path):
    (tmp_path / "plan.json").write_text(
        json.dumps({"walls": [[0, 0, 5, 0], [5, 0, 5, 5], [5, 5, 0, 0]], "start": [4, 1]})
    )
    wider = replace(CAMPAIGN, worlds=("paper-fig4", str(tmp_path / "plan.json")))
    folders = made(tmp_path / "one", SAME), made(tmp_path / "two", SAME, wider)
    for sides, count in ((folders, "only_second"), (folders[::-1], "only_first")):
        contrast(*sides, tmp_path / count)
        trials_ = read_contrast(tmp_path / count)["trials"]
        assert (trials_["shared"], trials_[count]) == (12, 12)


def test_campaigns_that_share_no_trial_or_whose_worlds_differ_are_refused(tmp_path):
    one = made(tmp_path / "one", SAME)
    apart = made(tmp_path / "apart", SAME, replace(CAMPAIGN, first_seed=9))
    with pytest.raises(UsageError, match=r"^expected campaigns that share trials, found .*one and .*apart with none"):
        contrast(one, apart, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    for name, wall in (("this", 2.0), ("that", 3.0)):
        (tmp_path / name).mkdir()
        walls = [[0, 0, 5, 0], [5, 0, 5, 5], [5, 5, 0, 5], [0, 5, 0, wall]]
        (tmp_path / name / "plan.json").write_text(json.dumps({"walls": walls, "start": [1, 1]}))
    folders = []
    for name in ("this", "that"):
        campaign = replace(CAMPAIGN, worlds=("paper-fig4", str(tmp_path / name / "plan.json")), trials=1)
        with opened(tmp_path / f"{name}-out", campaign):
            folders.append(tmp_path / f"{name}-out")
    with pytest.raises(UsageError, match="expected one world plan, found two that differ"):
        contrast(*folders, tmp_path / "out")


def test_a_folder_without_a_contrast_is_told(tmp_path):
    with pytest.raises(UsageError, match="compare --against"):
        read_contrast(tmp_path)


def test_a_back_end_in_an_arm_is_held_against_itself_alone(tmp_path):
    before = {cell: 1.0 + k for k, cell in enumerate(TIMES)}
    contrast(made(tmp_path / "one", before), made(tmp_path / "two", TIMES), tmp_path / "out")
    for row in read_contrast(tmp_path / "out")["differences"]:
        if row["measure"] == "wall_rmse_m":
            cell = row["backend"], "closed" if row["mode"] == "closed" else f"replay-{row['association']}"
            assert row["value"] == pytest.approx(TIMES[cell] / before[cell])


def test_one_trial_alone_may_differ(tmp_path):
    one = replace(CAMPAIGN, backends=("full-ekf",), arms=("closed",), trials=1)
    before, after = ({cell: times for cell in TIMES} for times in (1.0, 2.0))
    contrast(made(tmp_path / "one", before, one), made(tmp_path / "two", after, one), tmp_path / "out")
    assert len(read_contrast(tmp_path / "out")["different_trials"]) == 1


def test_a_contrast_that_cannot_be_read_names_the_remedy(tmp_path):
    (tmp_path / "contrast.json").write_text("[]")
    with pytest.raises(UsageError, match=r": run `compare --against` again$"):
        read_contrast(tmp_path)
