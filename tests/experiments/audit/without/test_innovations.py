"""Innovations of runs are judged as what they are: of the models, not of the pose."""

import csv
import shutil
from dataclasses import replace

import numpy as np
import pytest

import chainslam
from chainslam.experiments.campaign.comparison.consistency import CONSISTENT, OVERCONFIDENT
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.audit.draws import interval
from chainslam.experiments.library.audit.without.inner import Inner, pool
from chainslam.experiments.library.audit.without.innovations import TOLD, effective_dof


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    out = tmp_path_factory.mktemp("innovations") / "run"
    chainslam.explore("paper-fig4", seed=2, max_steps=40, backend="full-ekf", out=out)
    return out


def test_a_run_with_a_truth_is_judged_by_it_unless_asked_and_one_without_by_its_innovations(run, tmp_path, capsys):
    assert main(["audit", str(run)]) == 0
    assert "ANEES" in capsys.readouterr().out
    assert main(["audit", str(run), "--without-truth"]) == 0
    asked = capsys.readouterr().out
    assert asked.startswith("run: observation and motion model: ")
    assert "ANEES" not in asked
    assert "the pose itself cannot be judged" in asked
    real = tmp_path / "run"
    shutil.copytree(run, real)
    (real / "trajectory_true.tum").unlink()
    assert main(["audit", str(real)]) == 0
    assert capsys.readouterr().out == asked
    found = chainslam.audit(real)
    assert repr(found) + "\n" == asked
    assert found.without_truth[0].mean == pytest.approx(chainslam.load(run).summary["nis"], rel=1e-6)
    assert chainslam.audit(run, without_truth=True).asked == ("chainslam", "audit", str(run), "--without-truth")
    assert "NIS" in chainslam.audit(real).report(tmp_path / "out").read_text()


def test_runs_of_one_back_end_are_pooled_and_others_told_one_by_one(run, tmp_path, capsys):
    for name, backend in (("one", None), ("two", None), ("other", "block-ekf")):
        shutil.copytree(run, tmp_path / name / "run")
        if backend is not None:
            path = tmp_path / name / "run" / "summary.json"
            path.write_text(path.read_text().replace('"full-ekf"', f'"{backend}"'))
    one, two, other = (tmp_path / name / "run" for name in ("one", "two", "other"))
    assert main(["audit", str(one), str(two), "--without-truth"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith("run (1): observation and motion model")
    assert told[-1].startswith("2 runs together: ")
    assert "mean NIS per degree of freedom" in told[-1]
    found = chainslam.audit([one, two], without_truth=True)
    assert found.pooled.mean == pytest.approx(found.without_truth[0].mean)
    assert main(["audit", str(one), str(other), "--without-truth"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "not pooled, since they are of different kinds: scans of full-ekf, scans of block-ekf"


def test_runs_whose_mean_is_that_behind_their_gate_are_not_called_cautious_together():
    values = np.full(60_000, 0.8 * 2)
    ones = [Inner(name, TOLD, np.arange(60_000.0), values, np.full(60_000, 2), (), 120_000.0, (), 0.8) for name in "ab"]
    assert pool(ones).mean == pytest.approx(0.8)
    assert pool(ones).verdict.words == ones[0].verdict.words == CONSISTENT
    assert pool([replace(each, least=1.0) for each in ones]).verdict.words != CONSISTENT


def test_innovations_four_times_as_large_reject_the_models(run, tmp_path):
    wrong = tmp_path / "run"
    shutil.copytree(run, wrong)
    rows = list(csv.DictReader((run / "steps.csv").read_text().splitlines()))
    with (wrong / "steps.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(row | {"nis": 4.0 * float(row["nis"])} for row in rows)
    [before] = chainslam.audit(run, without_truth=True).without_truth
    [found] = chainslam.audit(wrong, without_truth=True).without_truth
    assert found.mean == pytest.approx(4.0 * before.mean)
    assert found.effective_dof == pytest.approx(before.effective_dof)
    assert found.verdict.words == OVERCONFIDENT


def test_what_has_no_innovations_is_refused_in_one_line(run, tmp_path):
    (tmp_path / "a.tum").write_text("0 0 0 0 0 0 0 1\n")
    bare = tmp_path / "bare"
    bare.mkdir()
    (bare / "steps.csv").write_text("time_s,x_m,y_m,heading_rad\n0,0,0,0\n")
    cut = tmp_path / "cut"
    shutil.copytree(run, cut)
    (cut / "config.json").write_text('{"trial": {"mission": 1}}')
    lost = tmp_path / "lost"
    shutil.copytree(run, lost)
    (lost / "config.json").unlink()
    for path, told in (
        (cut, "expected the gate of the matching in .* found None"),
        (lost, "expected config.json as this version writes it"),
        (tmp_path / "a.tum", "expected the folder of a run or a g2o graph for --without-truth"),
        (bare, "found no nis"),
    ):
        with pytest.raises(chainslam.UsageError, match=told):
            chainslam.audit(path, without_truth=True)
    with pytest.raises(chainslam.UsageError, match="expected one of --truth, --without-truth"):
        chainslam.audit(run, truth=run / "trajectory_true.tum", without_truth=True)


@pytest.mark.parametrize("rho", [0.0, 0.6, 0.9])
def test_the_interval_of_the_mean_of_a_true_series_excludes_one_in_about_five_per_cent(rho):
    rng, runs, n, d = np.random.default_rng(1), 300, 400, 4
    white = np.zeros((runs, n, d))
    state = rng.standard_normal((runs, d))
    for k in range(n):
        white[:, k] = state
        state = rho * state + np.sqrt(1.0 - rho**2) * rng.standard_normal((runs, d))
    squared, dof = np.sum(white**2, axis=2), np.full(n, d)
    outside = []
    for each in squared:
        found = effective_dof(each, dof)
        low, high = interval(float(each.sum()) / dof.sum(), found)
        assert found <= 1.0001 * n * d
        outside.append(low > 1.0 or high < 1.0)
    assert 0.01 <= np.mean(outside) <= 0.12


def test_values_that_scatter_more_than_a_chi_square_count_less():
    rng = np.random.default_rng(2)
    squared = rng.chisquare(2, 2000) * np.where(rng.random(2000) < 0.1, 10.0, 0.1)
    assert effective_dof(squared, np.full(2000, 2)) < 0.5 * 4000
