"""The tables of the paper's figures say what the stored drives say, of each figure and back end."""

import json
from pathlib import Path

import numpy as np
import pytest

from chainslam.experiments.replays.corridor import Loop, drive
from chainslam.experiments.replays.ideal import IdealEkf
from chainslam.experiments.replays.observations import ride
from chainslam.experiments.reproductions import REPRODUCTIONS, fig8, table1
from chainslam.experiments.reproductions.runs import maps
from chainslam.experiments.scenario import drawn_start
from chainslam.slam.backends import BACKENDS
from chainslam.slam.evaluation.consistency import bound_margins
from chainslam.slam.geometry.poses import wrap
from studies.paper import following, page, rivals, study
from studies.paper.following import ROWS as FOLLOWED
from studies.runner.rows import last

ROOT = Path(__file__).resolve().parents[2]


def row(figure, seed, **numbers):
    return {"code": "none", "figure": figure, "seed": seed, "numbers": numbers}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ([1.0, 3.0, 8.0], "3 (1 to 8)"),
        ([0, 0, 3], "1 (0 to 3)"),
        ([2.5, 2.5], "2.5"),
        ([True, False, True], "2 of 3"),
        (["2 of 2", "2 of 2"], "2 of 2"),
        (["2 of 2", "1 of 2", "2 of 2"], "2 of 2 in 2; 1 of 2 in 1"),
        (list("abcd"), "4 different ones"),
        ([12345.0, 999.0], "6,670 (999 to 12,300)"),
        ([4.0, None], "4; 1 without"),
        ([None, None], "-"),
    ],
)
def test_a_cell_says_middle_range_and_what_lacks(values, words):
    assert page.cell(values) == words


def test_a_table_has_the_papers_value_beside_each_back_end():
    drives = [
        {"a": {"path, m": 1.0}, "b": {"path, m": 2.0, "walls": 1}},
        {"a": {"path, m": 3.0}, "b": {"path, m": 4.0}},
    ]
    lines = page.table_of(drives, {"path, m": 33.0})
    assert lines[0] == ["quantity", "the paper", "a", "b"]
    assert lines[1] == ["path, m", "33.0", "2 (1 to 3)", "3 (2 to 4)"]
    assert lines[2] == ["walls", "", "-", "1; 1 without"]
    rows = [row("fig8", 2, **drives[1]), row("fig8", 1, **drives[0])]
    ((above, table),) = page.figures(rows).items()
    assert above.startswith("## Figure 8: the map of the cyclic environment")
    assert table[1] == ["path, m", "33.0", "2 (1 to 3)", "3 (2 to 4)"]
    assert page.tables_of(rows)[0].rows[0] == ("path, m", "33.0", "2 (1 to 3)", "3 (2 to 4)")


def test_every_figure_has_stored_rows():
    rows = last(ROOT / page.ROWS, page.NAMES)
    assert {each["figure"] for each in rows} <= set(REPRODUCTIONS)
    assert len(rows) >= len(REPRODUCTIONS)


def test_a_row_holds_the_numbers_of_one_drive_by_each_back_end(monkeypatch):
    monkeypatch.setattr(table1, "DRIVES", 1)
    for module in (table1, maps):
        monkeypatch.setattr(module, "BESIDE", ("block-ekf", "full-ekf"))
    rows = study.numbers_of((("table1", "fig8"), 2))
    assert [(each["figure"], each["seed"]) for each in rows] == [("table1", 2), ("fig8", 2)]
    distances, drawn = rows[0]["numbers"], fig8.reproduce(2)
    assert json.loads(json.dumps(rows[1]["numbers"])) == drawn.ours
    whole = table1.reproduce(2)
    for name, own in distances.items():
        for pair in table1.BY_HAND:
            assert own[f"{pair}, m"] == whole.ours[name][f"{pair}, m"]
            error = 1e3 * (own[f"{pair}, m"] - whole.ours["true"][f"{pair}, m"])
            np.testing.assert_allclose(own[f"{pair}, error, mm"], error)
            inside = abs(error) <= own[f"{pair}, half of the 95 % interval, mm"]
            assert own[f"{pair} in its interval"] is bool(inside)


def alike(stored, made):
    """Whether two records of numbers are the same but for rounding on another processor."""
    if isinstance(stored, dict):
        return stored.keys() == made.keys() and all(alike(stored[key], made[key]) for key in stored)
    if isinstance(stored, float) and isinstance(made, float):
        return made == pytest.approx(stored, rel=1e-6, abs=1e-9)
    return stored == made


@pytest.mark.long
@pytest.mark.parametrize("figures", [("table1", "fig8"), ("fig9",), ("fig10", "fig11")])
def test_the_stored_rows_of_the_figures_are_of_todays_behaviour(figures):
    """One drive of each is made anew: a row of an older behaviour tells what the code no longer does (`make paper`)."""
    rows = last(ROOT / page.ROWS, page.NAMES)
    for made in study.numbers_of((figures, 1)):
        (stored,) = [each for each in rows if (each["figure"], each["seed"]) == (made["figure"], 1)]
        assert alike(stored["numbers"], json.loads(json.dumps(made["numbers"])))


@pytest.mark.long
def test_the_stored_rows_of_both_followings_are_of_todays_behaviour():
    stored = {tuple(row[name] for name in following.NAMES): row for row in last(ROOT / FOLLOWED, following.NAMES)}
    for task in following.FollowingStudy(seeds=1).tasks():
        figure, backend, strategy = task[1], task[4], task[3]
        if figure in ("fig4", "fig8", "fig9") and backend != "graph" and strategy == "nearest-robot":
            (made,) = following._one(following.FollowingStudy.max_steps, task)
            kept = {key: value for key, value in stored[task].items() if key != "code"}
            assert alike(kept, json.loads(json.dumps(made)))


def test_the_ideal_filter_never_learns_where_the_world_lies_and_rides_beside_the_others(tmp_path, capsys):
    """P_k >= A P0 A' at the true positions, where all its Jacobians are."""
    seen = drive(Loop(30.0, after_m=5.0), 3)
    pose, cov = drawn_start(seen.chance, seen.true_poses_world[0], "large")
    ridden = ride(IdealEkf(pose, cov, seen), seen)
    assert bound_margins(seen.true_poses_world, ridden.estimated_cov, cov).min() > -1e-9
    assert ridden.map_anees < 2.0
    study = rivals.RivalStudy(("ring of 60 m",), ("full-ekf", "ideal-ekf"), seeds=1, first_seed=4, out=tmp_path / "r")
    study.run()
    assert "ring of 60 m, P0 small, true matches, drives: 1, from seed 4" in capsys.readouterr().out


def test_the_scores_of_a_ride_are_those_of_its_estimates_and_innovations():
    """Held against the ride itself, of a filter whose intervals hold less often than they should."""
    seen, make = drive(Loop(30.0, after_m=5.0), 3), BACKENDS["joint-block-ekf"].make
    found = dict(zip(rivals.SCORES, rivals.scores(*rivals.made("joint-block-ekf", "small", seen), seen), strict=True))
    pose, cov = drawn_start(seen.chance, seen.true_poses_world[0], "small")
    ridden = ride(make(pose, cov), seen)
    known = ride(make(*drawn_start(seen.chance, seen.true_poses_world[0], "zero")), seen)
    assert found["pose_anees"] == pytest.approx(ridden.pose_nees.mean() / 3.0)
    assert found["pose_anees_from_start"] == pytest.approx(known.pose_nees.mean() / 3.0)
    assert found["map_anees"] == pytest.approx(ridden.map_anees)
    off = np.hypot(*(known.estimated_world - known.true_poses_world)[:, :2].T)
    assert found["pose_rms_m"] == pytest.approx(np.sqrt(np.mean(off**2)))
    assert found["pose_sigma_m"] == pytest.approx(
        np.sqrt(np.mean(known.estimated_cov[:, 0, 0] + known.estimated_cov[:, 1, 1]))
    )
    error = ridden.estimated_world - ridden.true_poses_world
    sigma = np.sqrt([np.diag(each) for each in ridden.estimated_cov])
    inside = [
        np.abs(wrap(a)) <= 1.959964 * b if k == 2 else np.abs(a) <= 1.959964 * b
        for k, (a, b) in enumerate(zip(error.T, sigma.T, strict=True))
    ]
    assert np.mean(inside) < 0.9
    assert found["held"] == pytest.approx(np.mean(inside))
    assert 0.85 < found["nis"] < 1.3
    assert 0.88 < found["nis_in_band"] <= 1.0
