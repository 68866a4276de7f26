"""The studies of a strategy that turns back: rings to explore, pairs at equal metres, what is counted of each run."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.usage import UsageError
from chainslam.explore.goal import Goal
from chainslam.slam.geometry.lines import distance_to_segments
from studies.consistency import heading as heading_study
from studies.consistency.heading import HeadingStudy, Ring
from studies.exploration import adaptive as adaptive_study
from studies.exploration.adaptive import AdaptiveStudy, comparison_table, returns_table, values_of
from studies.exploration.ring_worlds import ring_world
from studies.runner.explored import Returns, explored

SCORED = {
    "status": "complete", "steps": 10, "path_length_m": 50.0, "pose_anees": 2.0, "map_anees": 1.0, "wall_rmse_m": 0.1,
    "wall_shape_m": 0.1, "double_entries": 1, "returns": 3, "coverage": 1.0, "heading_error_deg": 0.5,
    "contours_closed": 2, "contours_reachable": 2,
}  # fmt: skip


@pytest.mark.parametrize(("length", "seed"), [(24.0, 1), (30.0, 2), (120.0, 3)])
def test_a_ring_is_one_corridor_round_one_block_and_every_seed_another(length, seed):
    world = ring_world(length, seed)
    assert len(world.free.interiors) == 1
    corners = np.concatenate([[world.start[:2]], world.faces[:, 0]])
    # The corridor's middle has the length of the ring; niches widen it here and there.
    assert world.free.area == pytest.approx(2.4 * length, rel=0.25)
    assert world.reachable().contains(world.reachable().representative_point())
    assert len(world.reachable().interiors) == 1
    assert distance_to_segments(world.start[None, :2], world.faces).min() > 1.0
    assert not world.free.equals(ring_world(length, seed + 1).free)
    assert np.ptp(corners, axis=0).max() < 0.5 * length
    ahead = world.start[:2] + 2.0 * np.array([np.cos(world.start[2]), np.sin(world.start[2])])
    assert distance_to_segments(ahead[None], world.faces).min() > 1.0


def test_a_ring_without_a_block_is_refused():
    with pytest.raises(ValueError, match="24 m or more, found 20"):
        ring_world(20.0, 1)


def test_wheels_lose_the_heading_that_was_asked_for():
    trial = HeadingStudy().trial(Ring(30.0, 4.0, "adaptive", "graph", 7))
    wheels = trial.robot.wheels
    per_root_metre = np.hypot(wheels.slip, wheels.slip) / wheels.base_m
    assert np.rad2deg(per_root_metre) == pytest.approx(4.0)
    assert (trial.max_path_m, trial.strategy, trial.backend, trial.seed) == (60.0, "adaptive", "graph", 7)


def test_a_map_has_a_field_for_each_strategy_and_back_end_and_is_drawn_from_rows_that_are_kept(
    tmp_path, monkeypatch, capsys
):
    ran = []

    def explored_ring(trial, world):
        ran.append((trial.strategy, trial.backend, trial.seed, world.name))
        return SCORED | {"pose_anees": None if trial.seed == 2 else 2.0 + len(trial.backend)}

    monkeypatch.setattr(heading_study, "explored", explored_ring)
    study = HeadingStudy(
        backends=("full-ekf", "graph"), strategies=("nearest-robot", "adaptive"), length_m=(30.0,), seeds=2,
        out=tmp_path / "rows.jsonl", picture=tmp_path / "map.svg",
    )  # fmt: skip
    assert [ring.seed for ring in study.rings()] == [1] * 4 + [2] * 4
    replace(study, seeds=1).run()
    study.run()
    assert len(ran) == len(set(ran)) == 8
    assert ran[0] == ("nearest-robot", "full-ekf", 1, "ring-30-1")
    found = capsys.readouterr().out
    assert "graph, adaptive, 30 m, 4: 7.00, 7.00 (1 runs: no interval); 0.50; 1.0, 3.0; 2 of 2" in found
    assert (tmp_path / "map.svg").read_bytes().startswith(b"<?xml")
    replace(study, only_report=True, seeds=10).run()
    assert len(ran) == 8
    for wrong in ({"picture": tmp_path / "map.bmp"}, {"length_m": (20.0,)}, {"backends": ("ekf",)}):
        with pytest.raises(UsageError):
            replace(study, **wrong).run()


def rows_of_pairs(strategies, factor, seeds=12):
    """Return runs in which the first strategy's errors are `factor` times the others', and its doubles one more."""
    rng, rows = np.random.default_rng(2), []
    for seed in range(seeds):
        error = rng.uniform(0.01, 0.1)
        for k, strategy in enumerate(strategies):
            ratio = factor * rng.normal(1.0, 0.01) if k == 0 else 1.0
            row = {"world": "hall", "p0": "small", "backend": "block-ekf", "strategy": strategy, "seed": seed}
            rows.append(SCORED | row | {"wall_rmse_m": error * ratio, "double_entries": 5 + (k == 0)})
    return rows


def test_pairs_find_a_ratio_that_the_spread_between_runs_hides():
    rows = rows_of_pairs(("adaptive", "nearest-robot"), 0.8)
    first, second = (("block-ekf", name) for name in ("adaptive", "nearest-robot"))
    table = comparison_table(rows, first, [second], "p0 small")
    cells = [str(column._cells[0]) for column in table.columns]
    assert cells[0] == "block-ekf, nearest-robot"
    assert cells[1].startswith("x0.80 (0.79 to 0.8")
    assert cells[3] == "1.00 (1.00 to 1.00), 12"
    assert comparison_table(rows, first, [("graph", "adaptive")], "").columns[1]._cells[0] == "-"
    assert (
        values_of([*rows, rows[0] | {"wall_rmse_m": None, "seed": 99}], first, "wall_rmse_m").keys()
        == values_of(rows, first, "wall_rmse_m").keys()
    )


def test_returns_are_told_per_hundred_metres():
    rows = rows_of_pairs(("adaptive", "nearest-robot"), 1.0, seeds=4)
    table = returns_table(rows, "adaptive")
    assert [str(column._cells[0]) for column in table.columns] == [
        "hall", "small", "block-ekf", "4", "200", "12", "6.0", "2.00", "6.00",
    ]  # fmt: skip


def test_every_robot_drives_as_far_and_the_study_goes_on_where_it_was(tmp_path, monkeypatch):
    ran = []
    monkeypatch.setattr(adaptive_study, "explored", lambda trial: ran.append(trial) or SCORED)
    study = AdaptiveStudy(worlds=("hall",), backends=("graph",), seeds=2, out=tmp_path / "rows.jsonl")
    replace(study, seeds=1).run()
    study.run()
    assert [(trial.strategy, trial.seed) for trial in ran] == [
        (strategy, seed) for seed in (1, 2) for strategy in ("adaptive", "nearest-robot", "nearest-start")
    ]
    assert {trial.max_path_m for trial in ran} == {60.0}
    replace(study, seeds=5, only_report=True).run()
    assert len(ran) == 6


def test_a_return_is_counted_once_however_many_steps_it_takes():
    returns = Returns()
    home, again = (Goal("known-walls", None, None, np.zeros(2), "back") for _ in range(2))
    end = Goal("open-end", 1, 0, np.zeros(2), "nearest")
    for goal in (None, home, home, end, end, again, again, None):
        returns.watch(SimpleNamespace(decision=SimpleNamespace(goal=goal)))
    assert returns.count == 2


def test_a_run_is_scored_with_its_walls_and_what_was_entered_twice():
    row = explored(TrialConfig("paper-fig4", seed=2, max_steps=25))
    assert row["steps"] == 25
    assert row["returns"] == 0
    assert row["wall_rmse_m"] > 0.0
    assert row["double_entries"] == row["duplicate_lines"] + row["merges"] - row["false_merges"]
    assert 0.0 < row["heading_error_deg"] < 10.0
