"""A run in two lines: what happened, and how consistent it is; notes only where something was wrong."""

import json
import re

import pytest

from chainslam.experiments.commands.cli import main
from chainslam.experiments.views.numbers import number
from chainslam.experiments.views.run_lines import lines_of, notes_of


@pytest.fixture(scope="module")
def summary(tmp_path_factory):
    folder = tmp_path_factory.mktemp("told") / "run"
    assert main(["explore", "paper-fig8", "--max-steps", "20", "--out", str(folder)]) == 0
    return json.loads((folder / "summary.json").read_text())


def numbers_in(line):
    return re.findall(r"\d[\d.,]*\d|\d", line)


def test_a_run_is_told_by_its_end_its_errors_and_its_anees(summary):
    happened, consistent = lines_of([summary])
    assert summary["status"] in happened
    assert summary["reason"] in happened
    for value in (summary["path_length_m"], summary["steps"], 100.0 * summary["coverage"]):
        assert number(value) in numbers_in(happened)
    for value in (100.0 * summary["pose_rmse_m"], summary["pose_anees_from_start"], summary["map_anees"]):
        assert number(value) in numbers_in(consistent)


def test_runs_that_ended_alike_are_told_together_and_each_has_its_anees(summary):
    runs = [summary | {"backend": name, "pose_anees_from_start": value} for name, value in (("a", 2.0), ("b", 30.0))]
    happened, consistent = lines_of(runs)
    assert happened.count(summary["reason"]) == 1
    assert happened.startswith("a and b")
    assert ("a 2.00" in consistent, "b 30.0" in consistent) == (True, True)
    apart = lines_of([runs[0], runs[1] | {"status": "failed", "reason": "lost at step 9"}])[0]
    assert apart.index("a: ") < apart.index("b: failed")


def test_without_truth_walls_relations_and_nis_are_told(summary):
    untrue = summary | dict.fromkeys(("pose_rmse_m", "pose_anees_from_start", "coverage"))
    (_, consistent) = lines_of([untrue | {"nis": 0.5, "lines": 12, "duplicate_lines": 3}])
    assert numbers_in(consistent) == ["12", "3", "0.500", "1"]
    spread = {"count": 7, "translation_m": {"median": 0.25}, "rotation_rad": {"median": 0.1}}
    measured = {"relations": {"at_scans": {"all": spread}}, "relations_normalised": {"all": {"anees": 4.0}}}
    (_, consistent) = lines_of([untrue | measured | {"lines": 12, "duplicate_lines": 3}])
    assert numbers_in(consistent) == ["12", "3", "7", "0.250", "5.73", "4.00", "1"]


def test_a_noise_model_is_told_only_where_it_is_off(summary):
    untrue = summary | dict.fromkeys(("pose_rmse_m", "pose_anees_from_start", "coverage"))
    for nis, share, words in ((0.5, 0.2, "conservative"), (2.0, 0.2, "overconfident")):
        assert words in lines_of([untrue | {"nis": nis, "nis_in_band": share}])[1]
    assert "noise model" not in lines_of([untrue | {"nis": 0.9, "nis_in_band": 0.6}])[1]


def test_what_a_complete_run_did_not_reach_is_told_with_the_reasons(summary):
    ends = [{"why": "beyond the fence"}, {"why": "still open after 4 views"}, {"why": "still open after 4 views"}]
    gaps = [{"position_m": [1.0, 2.0], "why": "a gap of about 0.35 m"}] * 5
    left = {"certificate": {"open_ends": ends, "narrow_gaps": gaps}}
    happened, told, _ = lines_of([summary | {"outcome": "none-reachable"} | left])
    assert happened == lines_of([summary])[0]
    assert "3 open ends: still open after 4 views (2), beyond the fence (1)" in told
    assert (told.count("a gap of about 0.35 m"), "2 more" in told) == (3, True)
    assert len(lines_of([summary | left])) == 2, "a run that was stopped could have gone on"
    assert len(lines_of([summary | {"outcome": "all-closed", "certificate": {"open_ends": []}}])) == 2


def test_a_run_without_a_step_has_one_line():
    assert len(lines_of([{"status": "failed", "reason": "no wall", "steps": 0, "backend": "graph"}])) == 1


def test_notes_are_told_of_what_went_wrong_alone(summary):
    assert notes_of(summary) == []
    wrong = {"unstated_motions": 2, "lost_steps": 3, "own_beams": 40, "curved_share": 0.9, "wheel_noise_factor": 2.0}
    wrong |= {"range_bias_m": 0.03, "range_bias_sigma_m": 0.001, "certificate": {"reachable_way": 0.5}}
    told = notes_of(summary | wrong)
    assert [note for value in ("2 ", "3 ", "40 ", "+30.0 mm", "90.0 %", "2.00 times", "50.0 %")
            for note in told if value in note] == told  # fmt: skip
