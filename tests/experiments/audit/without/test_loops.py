"""A loop closure against the graph without it is what leaving it out and optimising again says."""

import json
from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.consistency import OVERCONFIDENT
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.audit.auditing import audit
from chainslam.experiments.library.audit.draws import interval
from chainslam.experiments.library.audit.reading import linear
from chainslam.experiments.library.audit.reading.graphs import graph_at
from chainslam.experiments.library.audit.reading.linear import optimised, pair_covs_of
from chainslam.experiments.library.audit.without.inner import pool
from chainslam.experiments.library.audit.without.loops import loops
from chainslam.experiments.usage import UsageError

from ..test_graphs import SIGMAS, drive, residual, slopes


def closures(graph):
    return np.flatnonzero(graph.pairs[:, 1] - graph.pairs[:, 0] > 1)


def test_a_closure_is_what_leaving_it_out_says(tmp_path):
    drive(tmp_path, noise=1e-3)  # so that all is linear
    found, graph = loops(tmp_path / "a.g2o"), graph_at(tmp_path / "a.g2o")
    left = []
    for edge in closures(graph):
        keep = np.delete(np.arange(len(graph.pairs)), edge)
        without = replace(
            graph, pairs=graph.pairs[keep], motions=graph.motions[keep], information=graph.information[keep]
        )
        without, again, _ = optimised(without, "a")
        i, j = graph.pairs[edge]
        ends = graph.motions[edge], without.poses_world[i], without.poses_world[j]
        G, [cov] = slopes(*ends), pair_covs_of(again)(np.array([i]), np.array([j]))
        S, e = G @ cov @ G.T + np.linalg.inv(graph.information[edge]), residual(*ends)
        left.append(e @ np.linalg.solve(S, e))
    assert found.squared == pytest.approx(np.array(left), rel=3e-3)
    assert np.all(found.squared < 1e-3)


def test_degrees_of_freedom_are_those_of_a_dense_computation(tmp_path):
    drive(tmp_path)
    graph, at, _ = optimised(graph_at(tmp_path / "a.g2o"), "a")
    rows = (3 * closures(graph)[:, None] + np.arange(3)).ravel()
    J = at.jacobian.toarray()
    W = np.zeros((len(J), len(J)))
    for k, each in enumerate(graph.information):
        W[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = each
    cov = np.zeros((J.shape[1], J.shape[1]))
    cov[3:, 3:] = np.linalg.inv((J.T @ W @ J)[3:, 3:])
    V = np.linalg.inv(W)[np.ix_(rows, rows)] - J[rows] @ cov @ J[rows].T
    total, count = 0.0, len(rows) // 3
    whiten = [np.linalg.inv(np.linalg.cholesky(V[3 * k : 3 * k + 3, 3 * k : 3 * k + 3])) for k in range(count)]
    for i in range(count):
        for j in range(count):
            total += np.sum((whiten[i] @ V[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] @ whiten[j].T) ** 2)
    assert loops(tmp_path / "a.g2o").effective_dof == pytest.approx(len(rows) ** 2 / total, rel=1e-6)


def drawn(folder, seeds, told=1.0):
    for seed in range(seeds):
        drive(folder, seed=seed, told=told, name="g")
        yield loops(folder / "g.g2o")


@pytest.mark.long
def test_of_100_true_graphs_about_five_per_cent_are_rejected(tmp_path):
    right = list(drawn(tmp_path, 100))
    assert np.mean([each.mean for each in right]) == pytest.approx(1.0, abs=0.1)
    assert 1 <= sum(each.interval[0] > 1.0 or each.interval[1] < 1.0 for each in right) <= 10


def test_information_four_times_too_large_is_found_and_a_true_one_not_suspected(tmp_path):
    right, wrong = list(drawn(tmp_path, 5)), list(drawn(tmp_path, 5, told=4.0))
    assert [each.verdict.words for each in right].count(OVERCONFIDENT) == 0
    assert [each.verdict.words for each in wrong].count(OVERCONFIDENT) >= 4
    for one, other in zip(right, wrong, strict=True):
        assert other.mean == pytest.approx(4.0 * one.mean, rel=1e-6)
        assert other.effective_dof == pytest.approx(one.effective_dof)


def test_graphs_without_a_truth_are_pooled(tmp_path, capsys):
    for seed in range(3):
        drive(tmp_path, seed=seed, told=4.0, name=f"g{seed}")
    paths = [tmp_path / f"g{seed}.g2o" for seed in range(3)]
    found = audit(paths)
    assert found.pooled.mean == pytest.approx(np.mean([each.mean for each in found.without_truth]))
    dof = 9.0 / sum(1.0 / each.effective_dof for each in found.without_truth)
    assert (found.pooled.low, found.pooled.high) == pytest.approx(interval(found.pooled.mean, dof))
    assert found.pooled.verdict.words == OVERCONFIDENT
    assert main(["audit", *map(str, paths), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "3 runs together: overconfident by a factor of" in told
    assert "mean NEES per degree of freedom" in told
    record = json.loads((tmp_path / "out" / "audit.json").read_text())["pooled"]
    assert (record["statistic"], record["mean"]) == ("NEES per degree of freedom", found.pooled.mean)
    assert "3 runs together" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.long
def test_of_20_groups_of_five_true_graphs_few_are_rejected(tmp_path):
    every = list(drawn(tmp_path, 100))
    found = [pool(every[k : k + 5]) for k in range(0, 100, 5)]
    assert sum(each.low > 1.0 or each.high < 1.0 for each in found) <= 3


def with_line(path, of, change):
    lines = path.read_text().splitlines()
    [k] = [k for k, line in enumerate(lines) if line.startswith(of)]
    words = lines[k].split()
    words[3] = repr(float(words[3]) + change)
    path.write_text("\n".join([*lines[:k], " ".join(words), *lines[k + 1 :]]))


def test_a_wrong_closure_is_named_and_the_command_says_what_it_cannot_tell(tmp_path, capsys):
    drive(tmp_path)
    with_line(tmp_path / "a.g2o", "EDGE_SE2 9 30 ", 0.5)
    assert main(["audit", str(tmp_path / "a.g2o"), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "loop closures do not fit: 9-30 (0." in told
    assert "the pose itself cannot be judged" in told
    [record] = json.loads((tmp_path / "out" / "audit.json").read_text())["without_truth"]
    assert record["misfits"][0].startswith("9-30 ")
    assert record["count"] == 8
    page = (tmp_path / "out" / "report.html").read_text()
    for part in ("without a truth", "9-30", "id of the later pose", "cannot tell"):
        assert part in page
    assert r"\toprule" in (tmp_path / "out" / "tables.tex").read_text()


def test_a_graph_that_is_not_optimised_is_optimised_and_told(tmp_path, monkeypatch):
    drive(tmp_path)
    before = loops(tmp_path / "a.g2o")
    with_line(tmp_path / "a.g2o", "VERTEX_SE2 20 ", 0.3)
    found = loops(tmp_path / "a.g2o")
    assert found.squared == pytest.approx(before.squared, rel=1e-3)
    assert "its poses were optimised first" in found.notes[0]
    assert before.notes == ()
    monkeypatch.setattr(linear, "ROUNDS", 2)
    with pytest.raises(UsageError, match="does not converge: optimise it"):
        loops(tmp_path / "a.g2o")


def test_closures_without_positive_definite_information_are_refused(tmp_path):
    w = (SIGMAS**-2.0).tolist()
    lines = [f"VERTEX_SE2 {k} {k} 0 0" for k in range(3)]
    lines += [f"EDGE_SE2 {k} {k + 1} 1 0 0 {w[0]} 0 0 {w[1]} 0 {w[2]}" for k in range(2)]
    (tmp_path / "a.g2o").write_text("\n".join([*lines, "EDGE_SE2 0 2 2 0 0 1 2 0 1 0 1"]))
    with pytest.raises(UsageError, match="with positive definite information, found none"):
        audit(tmp_path / "a.g2o")


@pytest.mark.parametrize(
    ("edges", "told"),
    [(((0, 1), (1, 2)), "found none: nothing predicts one"), (((0, 1), (0, 2)), "that the rest predicts, found none")],
)
def test_graphs_without_a_closure_that_can_be_judged_are_refused(edges, told, tmp_path):
    w = (SIGMAS**-2.0).tolist()
    lines = [f"VERTEX_SE2 {k} {k} 0 0" for k in range(3)]
    lines += [f"EDGE_SE2 {i} {j} {j - i} 0 0 {w[0]} 0 0 {w[1]} 0 {w[2]}" for i, j in edges]
    (tmp_path / "a.g2o").write_text("\n".join(lines))
    with pytest.raises(UsageError, match=told):
        audit(tmp_path / "a.g2o")
