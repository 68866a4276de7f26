"""Schools: runs of one plan and seed are pairs, and a sign test tells whether one back end loses fewer maps."""

from math import comb

import pytest

from studies.exploration.schools import SchoolsStudy, lost_in_pairs


def row(file, seed, backend, anees):
    return {"file": file, "seed": seed, "backend": backend, "pose_anees": anees}


def test_only_pairs_of_one_plan_and_seed_count_and_only_those_that_differ():
    rows = [row(f"{k}.json", 1, "full-ekf", 4.0 if k < 7 else 1.0) for k in range(12)]
    rows += [row(f"{k}.json", 1, "invariant-ekf", 5.0 if k in (0, 11) else 1.0) for k in range(12)]
    rows += [row("0.json", 2, "full-ekf", 9.0), row("1.json", 2, "full-ekf", None), row("1.json", 2, "graph", 9.0)]
    rows += [row("1.json", 2, "invariant-ekf", 9.0)]
    pairs, only_full, only_invariant, p = lost_in_pairs(rows, "full-ekf", "invariant-ekf")
    assert (pairs, only_full, only_invariant) == (12, 6, 1)
    assert p == pytest.approx(2 * sum(comb(7, k) for k in (0, 1)) / 2**7)
    assert lost_in_pairs(rows, "graph", "full-ekf")[3] == 1.0


def test_the_runs_of_a_plan_stand_beside_each_other(tmp_path):
    for name in "ab":
        (tmp_path / f"cml_{name}.json").touch()
    trials = SchoolsStudy(tmp_path, backends=("full-ekf", "graph"), seeds=(1, 2)).trials()
    assert [(trial.seed, trial.world[-6:], trial.backend) for trial in trials[:3]] == [
        (1, "a.json", "full-ekf"), (1, "a.json", "graph"), (1, "b.json", "full-ekf")
    ]  # fmt: skip
    assert [trial.seed for trial in trials] == [1] * 4 + [2] * 4
