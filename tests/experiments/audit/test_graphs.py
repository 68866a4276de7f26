"""Marginals of a pose graph are those of a dense inverse and of GTSAM, and its relations are audited exactly."""

from pathlib import Path

import numpy as np
import pytest

from chainslam.experiments.library.audit.auditing import audit, read
from chainslam.experiments.library.audit.reading.graphs import graph_at
from chainslam.experiments.library.audit.verdicts import pool
from chainslam.experiments.usage import UsageError
from chainslam.slam.geometry.poses import compose, inverse

SIGMAS = np.array([0.03, 0.02, 0.01])
ROUNDS = 4


def residual(z, one, other):
    return compose(inverse(z), compose(inverse(one), other))


def slopes(z, one, other, h=1e-6):
    """Return the derivatives of a residual by motions of both poses, each in its own frame."""

    def at(d):
        return residual(z, compose(one, d[:3]), compose(other, d[3:]))

    return np.stack([(at(axis) - at(-axis)) / (2 * h) for axis in h * np.eye(6)], axis=1)


def drive(folder, count=45, told=1.0, seed=0, name="a", noise=1.0):
    """Write the optimised graph of a drive in circles, and its truth; return its covariance by a dense inverse."""
    rng = np.random.default_rng(seed)
    true = [np.zeros(3)]
    for _ in range(count - 1):
        true.append(compose(true[-1], np.array([0.5, 0.0, 0.3])))
    ends = [(k, k + 1) for k in range(count - 1)] + [(k, k + 21) for k in range(0, count - 21, 3)]
    seen = [compose(compose(inverse(true[i]), true[j]), noise * SIGMAS * rng.standard_normal(3)) for i, j in ends]
    poses = [np.zeros(3)]
    for z in seen[: count - 1]:
        poses.append(compose(poses[-1], z))
    W, H = np.diag(SIGMAS**-2.0), np.zeros((0, 0))
    for turn in range(ROUNDS):
        H, g = np.zeros((3 * count, 3 * count)), np.zeros(3 * count)
        for (i, j), z in zip(ends, seen, strict=True):
            e, at = residual(z, poses[i], poses[j]), np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
            A = slopes(z, poses[i], poses[j])
            H[np.ix_(at, at)] += A.T @ W @ A
            g[at] += A.T @ W @ e
        if turn < ROUNDS - 1:
            step = np.append(np.zeros(3), -np.linalg.solve(H[3:, 3:], g[3:])).reshape(-1, 3)
            poses = [compose(pose, d) for pose, d in zip(poses, step, strict=True)]
    w = (told * SIGMAS**-2.0).tolist()
    vertices = [f"VERTEX_SE2 {k} {x!r} {y!r} {t!r}" for k, (x, y, t) in enumerate(np.array(poses).tolist())]
    edges = [
        f"EDGE_SE2 {i} {j} {z[0]!r} {z[1]!r} {z[2]!r} {w[0]!r} 0 0 {w[1]!r} 0 {w[2]!r}"
        for (i, j), z in zip(ends, np.array(seen).tolist(), strict=True)
    ]
    (folder / f"{name}.g2o").write_text("\n".join([*vertices, *edges]))
    told_true = [f"VERTEX_SE2 {k} {x!r} {y!r} {t!r}" for k, (x, y, t) in enumerate(np.array(true).tolist())]
    (folder / f"{name}_true.g2o").write_text("\n".join(told_true))
    cov = np.zeros_like(H)
    cov[3:, 3:] = np.linalg.inv(H[3:, 3:]) / told
    return cov


def test_marginals_are_those_of_a_dense_inverse_and_of_gtsam(tmp_path):
    gtsam = pytest.importorskip("gtsam")
    cov, found = drive(tmp_path), read(tmp_path / "a.g2o")
    own = np.array([cov[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(45)])
    assert found.covs == pytest.approx(own, abs=1e-9)
    first, second = np.array([3, 10, 40, 7]), np.array([20, 3, 44, 7])
    at = [np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] for i, j in zip(first, second, strict=True)]
    dense = np.array([cov[np.ix_(rows, rows)] for rows in at])
    assert found.pair_covs(first, second) == pytest.approx(dense, abs=1e-9)
    # GTSAM takes the logarithm of a residual, g2o its coordinates: the same only where the residuals are 0.
    drive(tmp_path, noise=0.0)
    found = read(tmp_path / "a.g2o")
    graph, values = gtsam.readG2o(str(tmp_path / "a.g2o"), False)
    graph.add(gtsam.PriorFactorPose2(0, values.atPose2(0), gtsam.noiseModel.Isotropic.Sigma(3, 1e-7)))
    theirs = gtsam.Marginals(graph, values)
    assert found.covs == pytest.approx(np.array([theirs.marginalCovariance(k) for k in range(45)]), abs=1e-9)


def test_a_fixed_vertex_is_the_frame_of_the_others(tmp_path):
    drive(tmp_path)
    text = (tmp_path / "a.g2o").read_text()
    (tmp_path / "a.g2o").write_text(text + "\nFIX 20\n")
    found = read(tmp_path / "a.g2o")
    assert found.held == 20
    assert np.all(found.covs[20] == 0.0)
    audited = audit(tmp_path / "a.g2o", truth=tmp_path / "a_true.g2o").trajectories[0]
    assert audited.pose.count == 44
    assert audited.pose.low < 1.0


@pytest.mark.long
def test_relations_of_many_graphs_have_the_covariance_that_the_graph_says(tmp_path):
    found = []
    for seed in range(10):
        drive(tmp_path, seed=seed, name=f"g{seed}")
        found.append((tmp_path / f"g{seed}.g2o", tmp_path / f"g{seed}_true.g2o"))
    whole = audit([path for path, _ in found], truth=[true for _, true in found])
    assert whole.pooled is not None
    assert whole.pooled.low < 1.0 < whole.pooled.high
    steps = [each.lags[0] for each in whole.trajectories]
    assert not any(lag.is_bound for lag in steps)
    assert np.mean([lag.score.anees for lag in steps]) == pytest.approx(1.0, abs=0.12)
    longer = pool([each.lags[1].score for each in whole.trajectories])
    assert longer.low < 1.0 < longer.high


@pytest.mark.long
def test_of_60_graphs_few_are_rejected(tmp_path):
    scores = []
    for seed in range(60):
        drive(tmp_path, seed=seed)
        [found] = audit(tmp_path / "a.g2o", truth=tmp_path / "a_true.g2o").trajectories
        scores.append(found.pose)
    assert sum(each.low > 1.0 or each.high < 1.0 for each in scores) <= 6


def test_edges_that_do_not_fit_are_told(tmp_path):
    drive(tmp_path, told=9.0)
    found = audit(tmp_path / "a.g2o", truth=tmp_path / "a_true.g2o").trajectories[0]
    assert found.verdict.factor == pytest.approx(3.0, rel=0.35)
    assert any("their noise is larger than stated" in note for note in found.notes)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "found none"),
        ("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n", "found VERTEX_SE3:QUAT"),
        ("VERTEX_SE2 0 0 0\n", "with 4 numbers"),
        ("VERTEX_SE2 0 0 0 zero\n", "other words in line 1"),
        ("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 1 0 0 0 1 0 0 1 0 1\n", "between vertices, found none of id 1: add it"),
        ("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 0 0 0 0\n", "found 0 twice"),
        ("VERTEX_SE2 0.5 0 0 0\n", "whole numbers as ids, found 0.5"),
        ("VERTEX_SE2 8646911284551352320 0 0 0\n", "with 4 numbers within 1e+15"),
        ("VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 0 0 0 0 1 0 0 1 0 1\n", "found one at 0 only"),
        ("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\nVERTEX_SE2 2 0 0 0\nEDGE_SE2 0 1 0 0 0 1 0 0 1 0 1\n", "singular"),
    ],
)
def test_a_graph_that_cannot_be_read_is_refused_in_one_line(text, told, tmp_path):
    path: Path = tmp_path / "a.g2o"
    path.write_text(text)
    with pytest.raises(UsageError) as found:
        read(path)
    assert told in str(found.value)
    assert "\n" not in str(found.value)


def test_what_is_odd_in_a_graph_is_told(tmp_path):
    drive(tmp_path)
    path = tmp_path / "a.g2o"
    text = path.read_text()
    for more, note in (
        ("FIX 99", "FIX names no vertex of the graph, so 0 is held"),
        ("FIX 3 4", "of the vertices that FIX names only 3 is held"),
        ("EDGE_SE2 0 30 0 0 0 1 2 0 1 0 1", "the information of 1 edges has a negative eigenvalue"),
    ):
        path.write_text(f"{text}\n{more}\n")
        assert graph_at(path).notes == (note,)


def test_edges_that_say_nothing_of_some_direction_are_not_odd(tmp_path):
    """Their information is singular, and its eigenvalues are below 0 by the digits of the file alone."""
    drive(tmp_path)
    path, upper = tmp_path / "a.g2o", np.triu_indices(3)
    rows = [np.outer(v, v)[upper] for v in np.random.default_rng(1).standard_normal((40, 3))]
    more = [f"EDGE_SE2 {k} {k + 3} 0 0 0 " + " ".join(f"{w:.12g}" for w in row) for k, row in enumerate(rows)]
    path.write_text("\n".join([path.read_text(), *more]))
    assert graph_at(path).notes == ()


def test_lines_of_other_kinds_are_counted(tmp_path):
    drive(tmp_path)
    path = tmp_path / "a.g2o"
    path.write_text(path.read_text() + "\nVERTEX_XY 99 0 0\n")
    assert graph_at(path).notes == ("1 lines VERTEX_XY are left out",)
