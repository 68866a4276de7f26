"""Every number in the tables of a campaign, against numbers worked out by hand or by scipy."""

import csv
import json
from io import BytesIO

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.stats import chi2, norm

from chainslam.experiments.campaign.comparison.tables import (
    FIRST,
    GATE,
    band_scores,
    distance_errors,
    doubles,
    header_of,
    mark_rows,
    parquet_bytes,
    read_rows,
    step_rows,
    trial_row,
    write_table,
    write_tables,
)
from chainslam.experiments.campaign.plan import Campaign, Trial
from chainslam.experiments.campaign.scores.score import TrialScores
from chainslam.experiments.scoring.maps.measurements import Z_95
from chainslam.experiments.usage import UsageError

NAMES = {
    "world": "w", "strategy": "nearest-robot", "backend": "full-ekf", "mode": "closed", "association": "own", "seed": 1,
    "status": "complete",
}  # fmt: skip
SERIES = ("path_length_m", "pose_nees", "pose_trace", "pose_error_m", "heading_error_rad", "heading_sigma_rad")


def record(summary=None, **arrays):
    return TrialScores(
        NAMES | (summary or {}), {name: np.array(values, dtype=float) for name, values in arrays.items()}
    )


def run(nees, **changes):
    """A run of so many steps, in which all else grows with the step."""
    steps = np.arange(len(nees), dtype=float)
    series = {name: (k + 1.0) * (1.0 + steps) for k, name in enumerate(SERIES)} | {"pose_nees": nees}
    return record(**(series | changes))


def test_the_statistics_of_a_step_are_those_of_the_runs_that_go_on():
    first, second, third = run([3.0, 6.0, 1.0]), run([9.0, 2.0]), run([0.6])
    rows = step_rows([first, second, third])
    assert [row["step"] for row in rows] == [0, 1, 2]
    assert [row["trials"] for row in rows] == [3, 2, 1]
    assert [row["pose_anees"] for row in rows] == pytest.approx([12.6 / 9.0, 8.0 / 6.0, 1.0 / 3.0])
    assert [row["pose_nees_median"] for row in rows] == [3.0, 4.0, 1.0]
    for row, count in zip(rows, (3, 2, 1), strict=True):
        ends = chi2.ppf([0.025, 0.975], 3 * count) / (3 * count)
        assert (row["band_low"], row["band_high"]) == pytest.approx(tuple(ends), rel=1e-9)
        assert {key: row[key] for key in NAMES if key in row} == {
            key: NAMES[key] for key in ("world", "strategy", "backend", "mode", "association")
        }


def test_means_and_mean_squares_of_a_step_are_not_exchanged():
    one = run([3.0], path_length_m=[1.0], pose_trace=[2.0], pose_error_m=[3.0], heading_error_rad=[0.3],
              heading_sigma_rad=[0.1])  # fmt: skip
    two = run([3.0], path_length_m=[4.0], pose_trace=[5.0], pose_error_m=[4.0], heading_error_rad=[0.4],
              heading_sigma_rad=[0.7])  # fmt: skip
    (row,) = step_rows([one, two])
    assert (row["path_length_m"], row["pose_trace"]) == (2.5, 3.5)
    assert row["pose_error_rms_m"] == pytest.approx(12.5**0.5)
    assert row["heading_error_rms_rad"] == pytest.approx(0.125**0.5)
    assert row["heading_sigma_rms_rad"] == pytest.approx(0.5)


def test_a_step_without_a_covariance_is_in_no_nees_but_goes_on():
    rows = step_rows([run([np.nan, np.nan]), run([3.0, np.nan])])
    assert [row["trials"] for row in rows] == [2, 2]
    assert [row["pose_anees"] for row in rows] == [1.0, None]
    assert [row["pose_nees_median"] for row in rows] == [3.0, None]
    one = chi2.ppf([0.025, 0.975], 3) / 3.0
    assert [(row["band_low"], row["band_high"]) for row in rows] == [pytest.approx(tuple(one))] * 2
    assert step_rows([]) == step_rows([record()]) == []
    assert len(step_rows([run([3.0])])) == 1


def test_a_trial_without_steps_is_beside_those_that_have_some():
    rows = step_rows([record(), run([3.0])])
    assert [(row["trials"], row["pose_anees"]) for row in rows] == [(1, 1.0)]


def test_what_lies_outside_its_band_is_counted_on_both_sides():
    band = {"band_low": 0.5, "band_high": 2.0}
    steps = [band | {"pose_anees": value} for value in (0.4, 0.5, 1.0, 2.0, 2.1, 3.0, None)]
    assert band_scores([], steps)["steps_outside_band"] == pytest.approx(3 / 6)
    assert band_scores([], steps[:2])["steps_outside_band"] == 0.5
    assert band_scores([], steps[4:5])["steps_outside_band"] == 1.0
    none = band_scores([], [band | {"pose_anees": None}])
    assert none == {"steps_outside_band": None, "pooled_anees": None, "pooled_low": None, "pooled_high": None}


def test_the_pooled_anees_is_the_mean_over_the_runs_that_have_it_throughout():
    constant = [run([3.0, 3.0, 3.0]), run([6.0, 6.0]), run([900.0, np.nan]), record()]
    found = band_scores(constant, [])
    assert found["pooled_anees"] == pytest.approx((3.0 + 6.0) / 2 / 3.0)
    ends = chi2.ppf([0.025, 0.975], 6) / 6.0
    assert (found["pooled_low"], found["pooled_high"]) == pytest.approx(tuple(ends), rel=1e-9)


SEEN = {
    "matches_true": 180, "matches_missed": 15, "matches_false": 5, "duplicate_lines": 4, "merges": 7, "false_merges": 2,
}  # fmt: skip


def test_double_entries_are_those_left_and_those_merged_rightly():
    found = doubles(SEEN)
    assert found["sightings"] == 200
    assert found["missed_share"] == pytest.approx(0.075)
    assert found["double_entries"] == 9
    assert GATE == 0.99
    assert found["doubles_beyond_gate"] == pytest.approx(9 - 0.01 * 200)
    assert doubles({name: 0 for name in SEEN})["missed_share"] is None
    nothing = {"sightings": None, "missed_share": None, "double_entries": None, "doubles_beyond_gate": None}
    for name in SEEN:
        assert doubles(SEEN | {name: None}) == nothing
        assert doubles({key: value for key, value in SEEN.items() if key != name}) == nothing


def test_a_trial_is_a_row_of_plain_values_and_of_how_its_distances_fared():
    summary = SEEN | {
        "coverage": 0.5, "pose_anees": None, "set_aside": [1, 2, 3], "marks": {}, "traceback": "at line 3",
        "step_ms": {"mean": 2.0, "max": 9.0},
    }  # fmt: skip
    off = [0.0, 0.95, -0.95, 1.0, -1.0]
    row = trial_row(record(summary, distance_m=np.add(9.0, off), distance_true_m=5 * [9.0], distance_sigma_m=5 * [0.5]))
    assert (row["coverage"], row["pose_anees"], row["set_aside"]) == (0.5, None, 3)
    assert (row["distances"], row["distances_in_95"]) == (5, pytest.approx(0.6))
    assert (row["step_ms_mean"], row["step_ms_max"]) == (2.0, 9.0)
    assert row["double_entries"] == 9
    assert not {"traceback", "marks", "step_ms"} & row.keys()
    edge = trial_row(record(distance_m=[Z_95], distance_true_m=[0.0], distance_sigma_m=[1.0]))
    assert (Z_95, edge["distances_in_95"]) == (pytest.approx(norm.ppf(0.975), abs=1e-12), 1.0)
    bare = trial_row(record())
    assert (bare["set_aside"], bare["distances"], bare["distances_in_95"]) == (0, 0, None)


def test_the_error_of_a_distance_is_mapped_less_true():
    off, sigma = distance_errors(record(distance_m=[2.0, 3.0], distance_true_m=[1.5, 4.0], distance_sigma_m=[0.1, 0.2]))
    assert off.tolist() == [0.5, -1.0]
    assert sigma.tolist() == [0.1, 0.2]
    assert [values.tolist() for values in distance_errors(record())] == [[], []]


@pytest.mark.parametrize(
    ("status", "states", "lengths"),
    [
        ("complete", ["driving", "finished", "finished", "finished"], [10.1, 15.0, 15.0, 15.0]),
        ("stopped", ["driving", "failed", "failed", "driving"], [10.1, None, None, 15.0]),
    ],
)
def test_a_run_that_ended_before_a_mark_has_finished_or_failed_there(status, states, lengths):
    marks = {"10": {"path_length_m": 10.1}, "end": {"path_length_m": 15.0}}
    rows = mark_rows(record({"status": status, "marks": marks}))
    assert [row["metres"] for row in rows] == ["10", "20", "33", "end"]
    assert [row["state"] for row in rows] == states
    assert [row.get("path_length_m") for row in rows] == lengths
    assert all(row[key] == value for row in rows for key, value in (NAMES | {"status": status}).items())


def test_a_run_that_left_nothing_has_failed_at_every_mark():
    rows = mark_rows(record({"status": "failed"}))
    assert [(row["state"], len(row)) for row in rows] == 4 * [("failed", len(NAMES) + 2)]


def test_columns_stand_in_the_order_in_which_they_are_met(tmp_path):
    rows = [{"b": 1, "a": None}, {"b": 2, "c": 3.5}]
    assert header_of(rows, ("c", "x")) == ["c", "x", "b", "a"]
    table = pq.read_table(BytesIO(parquet_bytes(rows, ["b", "c"])))
    assert table.to_pydict() == {"b": [1, 2], "c": [None, 3.5]}
    write_table(tmp_path / "trials", rows, ("c",))
    assert (tmp_path / "trials.csv").read_text().split() == ["c,b,a", ",1,", "3.5,2,"]
    assert pq.read_table(tmp_path / "trials.parquet").column_names == ["c", "b", "a"]


def test_the_tables_of_a_campaign_hold_each_trial_once_cell_by_cell(tmp_path):
    backends = ("block-ekf", "full-ekf")
    trials = [Trial("w", "nearest-robot", name, "closed", seed) for name in backends for seed in (1, 2)]
    nees = {("block-ekf", 1): [30.0, 33.0], ("block-ekf", 2): [27.0], ("full-ekf", 1): [3.0], ("full-ekf", 2): [3.3]}

    def of(trial):
        made = run(nees[trial.backend, trial.seed])
        names = {"backend": trial.backend, "seed": trial.seed, "reason": "done", "pose_anees": 1.0}
        matches = ("matches_true", "matches_missed", "matches_false", "duplicate_lines", "merges", "false_merges")
        names |= dict.fromkeys(matches, 1)
        return TrialScores(made.summary | names, made.arrays)

    write_tables(tmp_path, Campaign(("w",), backends, ("nearest-robot",), 2, arms=("closed",)), trials, of)
    names = ("trials", "marks", "steps")
    tables = {name: list(csv.DictReader((tmp_path / f"{name}.csv").read_text().splitlines())) for name in names}
    assert [(row["backend"], row["seed"]) for row in tables["trials"]] == [(t.backend, str(t.seed)) for t in trials]
    assert list(tables["trials"][0])[: len(FIRST)] == list(FIRST)
    assert [row["backend"] for row in tables["marks"]] == 8 * ["block-ekf"] + 8 * ["full-ekf"]
    steps = [(row["backend"], row["step"], row["trials"], float(row["pose_anees"])) for row in tables["steps"]]
    assert steps == [
        ("block-ekf", "0", "2", 9.5), ("block-ekf", "1", "1", 11.0), ("full-ekf", "0", "2", pytest.approx(1.05)),
    ]  # fmt: skip
    said = json.loads((tmp_path / "comparison.json").read_text())
    assert [cell["steps_outside_band"] for cell in said["cells"]] == [1.0, 0.0]
    assert [cell["pooled_anees"] for cell in said["cells"]] == pytest.approx([9.75, 1.05])
    assert said["hypothesis"] is None
    told = {(f["kind"], f["backend"]): f["arms"]["closed"]["found"] for f in said["findings"]}
    assert told["outside", "block-ekf"] == {"share": 1.0}
    assert "no more duplicate walls than the 1 % that its gate must refuse" in {f["claim"] for f in said["findings"]}


def test_a_table_is_read_back_as_it_was_written(tmp_path):
    rows = [{"world": "w", "seed": 1, "pose_anees": 1.5}, {"world": "w", "seed": 2, "pose_anees": None}]
    folder = tmp_path / "key=value"
    folder.mkdir()
    (folder / "t.parquet").write_bytes(parquet_bytes(rows, list(rows[0])))
    assert read_rows(folder / "t.parquet") == rows
    assert read_rows(folder / "t.parquet", ("world", "seed")) == rows


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (parquet_bytes([{"world": "w"}], ["world"]), "no column seed"),
        (b"PAR1 cut short", "no table, or one that was cut short"),
    ],
)
def test_what_is_no_such_table_is_told_with_its_place_and_the_remedy(tmp_path, content, words):
    path = tmp_path / "t.parquet"
    path.write_bytes(content)
    with pytest.raises(UsageError, match=words) as told:
        read_rows(path, ("world", "seed", "pose_anees"))
    assert f"t.parquet as this version writes it in {tmp_path}" in str(told.value)
    assert "run the same `compare` to its end" in str(told.value)


def test_runs_without_a_nees_at_a_step_are_counted():
    rows = step_rows([run([3.0, np.nan]), run([9.0, 2.0]), run([np.nan, np.nan])])
    assert [row["without_nees"] for row in rows] == [1, 2]


def test_the_gate_of_the_campaign_decides_how_many_doubles_it_must_make():
    counts = {"matches_true": 900, "matches_missed": 100, "matches_false": 0}
    counts |= {"duplicate_lines": 20, "merges": 0, "false_merges": 0}
    for gate, beyond in ((GATE, 10.0), (0.95, -30.0)):
        assert trial_row(record(counts), gate)["doubles_beyond_gate"] == pytest.approx(beyond)
