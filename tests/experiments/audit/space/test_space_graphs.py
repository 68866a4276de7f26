"""Graphs in space: marginals, relations and loop closures are those of dense computations, of GTSAM and of draws."""

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation

import chainslam
from chainslam.experiments.campaign.comparison.consistency import OVERCONFIDENT
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.audit.auditing import audit, read
from chainslam.experiments.library.audit.geometry import space
from chainslam.experiments.library.audit.verdicts import pool
from chainslam.experiments.library.audit.without.loops import loops
from chainslam.experiments.scoring.without_truth.references import read_relations

from .graphs import SIGMAS, drive, helix, relations_file, relations_of, relations_written, written
from .spaces import FRAMES, hat, matrix, pose, vee

SWAP = [3, 4, 5, 0, 1, 2]


def residual(Z, one, other):
    X = np.linalg.inv(Z) @ np.linalg.inv(one) @ other
    turn = np.real(logm(X[:3, :3]))
    return np.array([*X[:3, 3], turn[2, 1], turn[0, 2], turn[1, 0]])


def dense(poses, ends, seen, W, h=1e-5):
    """Return the covariance of all poses but the first, by finite differences with exponentials of matrices."""
    H = np.zeros((6 * len(poses), 6 * len(poses)))
    for (i, j), z in zip(ends, seen, strict=True):
        one, other, Z = matrix(poses[i]), matrix(poses[j]), matrix(z)
        slopes = [
            residual(Z, one @ expm(hat(s[:6])), other @ expm(hat(s[6:])))
            - residual(Z, one @ expm(hat(-s[:6])), other @ expm(hat(-s[6:])))
            for s in h * np.eye(12)
        ]
        A, at = np.stack(slopes, axis=1) / (2 * h), np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
        H[np.ix_(at, at)] += A.T @ W @ A
    cov = np.zeros_like(H)
    cov[6:, 6:] = np.linalg.inv(H[6:, 6:])
    return cov


def test_marginals_and_pairs_are_those_of_a_dense_inverse(tmp_path):
    path, _, ends, seen = drive(tmp_path, count=14)
    found = read(path, space="space")
    cov = dense(found.poses_world, ends, seen, np.diag(SIGMAS**-2.0))
    own = np.array([cov[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(14)])
    assert found.covs == pytest.approx(own, abs=1e-9)
    first, second = np.array([3, 10, 13, 7]), np.array([11, 3, 4, 7])
    at = [np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] for i, j in zip(first, second, strict=True)]
    assert found.pair_covs(first, second) == pytest.approx(np.array([cov[np.ix_(r, r)] for r in at]), abs=1e-9)


def test_marginals_and_errors_are_those_of_gtsam(tmp_path):
    gtsam = pytest.importorskip("gtsam")
    path, _, _, _ = drive(tmp_path, noise=0.0)  # GTSAM takes the logarithm of a residual: the same where it is 0
    found = read(path, space="space")
    graph, values = gtsam.readG2o(str(path), True)
    graph.add(gtsam.PriorFactorPose3(0, values.atPose3(0), gtsam.noiseModel.Isotropic.Sigma(6, 1e-7)))
    theirs = gtsam.Marginals(graph, values)
    marginals = np.array([theirs.marginalCovariance(k)[SWAP][:, SWAP] for k in range(30)])
    assert found.covs == pytest.approx(marginals, abs=1e-9)
    path, true, _, _ = drive(tmp_path)
    [audited] = audit(path, truth=true, space="space").trajectories
    _, values = gtsam.readG2o(str(path), True)
    logs = [
        gtsam.Pose3.Logmap(values.atPose3(k).between(gtsam.Pose3(matrix(x))))[SWAP] for k, x in enumerate(helix(30))
    ]
    assert audited.errors == pytest.approx(np.array(logs)[1:], abs=1e-9)
    assert audited.frame == "body"


@pytest.mark.parametrize("frame", FRAMES)
def test_errors_of_any_frame_have_the_same_nees_to_first_order(frame, tmp_path):
    path, true, _, _ = drive(tmp_path, noise=1e-3)
    body, found = (audit(path, truth=true, space="space", error=each).trajectories[0] for each in (None, frame))
    assert found.frame == frame
    assert found.pose.anees == pytest.approx(body.pose.anees, rel=1e-2)
    assert found.pose.dof == pytest.approx(body.pose.dof, rel=1e-2)
    assert found.nees == pytest.approx(body.nees, rel=2e-2)
    assert found.covs == pytest.approx(
        space.to_frame(read(path, space="space").poses_world[1:], body.covs, "body", frame)
    )


def test_information_of_quaternions_is_that_of_half_the_rotation_vectors(tmp_path):
    path, _, ends, seen = drive(tmp_path, count=14)
    half = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
    root = np.random.default_rng(1).standard_normal((6, 6))
    W, poses = root @ root.T + np.diag(SIGMAS**-2.0), read(path, space="space").poses_world
    of_quaternions = written(tmp_path / "q.g2o", poses, ends, seen, W)
    of_vectors = written(tmp_path / "v.g2o", poses, ends, seen, half[:, None] * W * half)
    by_vectors, by_quaternions = (
        read(of_vectors, space="space"),
        read(of_quaternions, None, True, "space", "quaternion"),
    )
    assert by_quaternions.covs == pytest.approx(by_vectors.covs, rel=1e-9)
    assert any("--g2o-rotation quaternion" in note for note in by_vectors.notes)
    assert not any("--g2o-rotation" in note for note in by_quaternions.notes)
    q = Rotation.from_rotvec([1e-4, -2e-4, 3e-4]).as_quat()[:3]
    assert q == pytest.approx(0.5 * np.array([1e-4, -2e-4, 3e-4]), rel=1e-6)


def test_degrees_of_freedom_are_those_of_the_joint_covariance(tmp_path):
    path, true, ends, seen = drive(tmp_path, count=14)
    [found] = audit(path, truth=true, space="space").trajectories
    C = dense(read(path, space="space").poses_world, ends, seen, np.diag(SIGMAS**-2.0))[6:, 6:]
    for score, axes in ((found.pose, range(6)), (found.position, range(3)), (found.heading, range(3, 6))):
        at = (6 * np.arange(13)[:, None] + np.array(axes)).ravel()
        part = C[np.ix_(at, at)]
        L = np.zeros_like(part)
        for k in range(0, len(at), len(axes)):
            L[k : k + len(axes), k : k + len(axes)] = np.linalg.cholesky(part[k : k + len(axes), k : k + len(axes)])
        K = np.linalg.solve(L, np.linalg.solve(L, part).T)
        assert score.dof == pytest.approx(len(at) ** 2 / np.sum(K**2), rel=1e-6)
        assert score.draws == pytest.approx(score.dof / len(axes))


def audited_graphs(folder, seeds, told=1.0):
    for seed in range(seeds):
        path, true, _, _ = drive(folder, seed=seed, told=told)
        yield audit(path, truth=true, space="space").trajectories[0]


def rejected(scores):
    return sum(each.low > 1.0 or each.high < 1.0 for each in scores)


def test_graphs_together_are_as_their_marginals_say_and_twice_the_information_is_overconfident(tmp_path):
    right, wrong = (list(audited_graphs(tmp_path, 12, told)) for told in (1.0, 2.0))
    scores = [each.pose for each in right]
    assert pool(scores).low < 1.0 < pool(scores).high
    assert rejected([each.pose for each in right]) <= 3
    assert not any(each.lags[0].is_bound for each in right)
    assert pool([each.pose for each in wrong]).verdict.words == OVERCONFIDENT
    assert pool([each.pose for each in wrong]).verdict.factor == pytest.approx(np.sqrt(2.0), rel=0.15)


def test_of_60_graphs_few_are_rejected(tmp_path):
    right = list(audited_graphs(tmp_path, 60))
    assert rejected([each.pose for each in right]) <= 6
    assert rejected([each.lags[0].score for each in right]) <= 8


@pytest.mark.long
def test_of_100_graphs_about_five_are_rejected(tmp_path):
    right = list(audited_graphs(tmp_path, 100))
    assert np.mean([each.pose.anees for each in right]) == pytest.approx(1.0, abs=0.06)
    assert 1 <= rejected([each.pose for each in right]) <= 10
    assert 1 <= rejected(map(Interval, closures(tmp_path, 100))) <= 10


class Interval:
    """The interval of loop closures, as scores have it."""

    def __init__(self, inner):
        self.low, self.high = inner.interval


def closures(folder, seeds, told=1.0):
    for seed in range(seeds):
        yield loops(drive(folder, seed=seed, told=told)[0], "space")


def test_loop_closures_in_space_are_judged(tmp_path, capsys):
    right, wrong = list(closures(tmp_path, 4)), list(closures(tmp_path, 4, told=4.0))
    assert [each.verdict.words for each in right].count(OVERCONFIDENT) == 0
    assert [each.verdict.words for each in wrong].count(OVERCONFIDENT) == 4
    for one, other in zip(right, wrong, strict=True):
        assert set(one.dof) == {6}
        assert other.mean == pytest.approx(4.0 * one.mean, rel=1e-6)
    path, _, ends, seen = drive(tmp_path)
    seen[ends.index((9, 18)), 2] += 0.7
    written(path, read(path, space="space").poses_world, ends, seen, np.diag(SIGMAS**-2.0))
    assert main(["audit", str(path), "--space", "space", "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "loop closures do not fit: 9-18 (0." in told
    assert "its poses were optimised first" in told


def test_a_closure_in_space_is_what_leaving_it_out_says(tmp_path):
    path, _, ends, seen = drive(tmp_path, count=14, noise=1e-3)  # so that all is linear
    found, W = loops(path, "space"), np.diag(SIGMAS**-2.0)
    left = []
    for edge in [k for k, (i, j) in enumerate(ends) if j - i > 1]:
        rest = [k for k in range(len(ends)) if k != edge]
        poses, (i, j) = read(path, space="space").poses_world, ends[edge]
        less = written(tmp_path / "less.g2o", poses, [ends[k] for k in rest], seen[rest], W)
        without = chainslam_optimised(less)
        cov = dense(without, [ends[k] for k in rest], seen[rest], W)
        at = np.r_[6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
        motion = space.between(without[i][None], without[j][None])
        [S] = space.relation_covs(motion, cov[np.ix_(at, at)][None])
        e = residual(matrix(seen[edge]), matrix(without[i]), matrix(without[j]))
        left.append(e @ np.linalg.solve(S + np.linalg.inv(W), e))
    assert found.squared == pytest.approx(np.array(left), rel=5e-3)


def chainslam_optimised(path):
    from chainslam.experiments.library.audit.reading.graphs import graph_at
    from chainslam.experiments.library.audit.reading.linear import optimised

    return optimised(graph_at(path, "space", "vector"), "less")[0].poses_world


def test_relations_in_space_are_read_as_turns_about_fixed_axes(tmp_path):
    (tmp_path / "r").write_text("1 2 0.1 0.2 0.3 0.4 -0.5 0.6\n")
    [found] = read_relations(tmp_path / "r", True).motions
    roll, pitch, yaw = (expm(hat(np.array([0, 0, 0, *axis]))) for axis in np.diag([0.4, -0.5, 0.6]))
    assert matrix(found)[:3, :3] == pytest.approx((yaw @ pitch @ roll)[:3, :3], abs=1e-12)
    assert found[:3] == pytest.approx([0.1, 0.2, 0.3])


def test_relations_judge_graphs_in_space_exactly_and_trajectories_by_a_bound(tmp_path):
    ends = [(k, k + 6) for k in range(0, 24, 2)]
    exact, scores = relations_file(tmp_path / "r", helix(30), ends), {1.0: [], 2.0: []}
    for told, kept in scores.items():
        for seed in range(12):
            path, _, _, _ = drive(tmp_path, seed=seed, told=told)
            [found] = audit(path, relations=exact, space="space").trajectories
            assert not found.is_bound
            assert found.pose.count == 12
            kept.append(found.pose)
    assert pool(scores[1.0]).low < 1.0 < pool(scores[1.0]).high
    assert pool(scores[2.0]).verdict.words == OVERCONFIDENT
    one = read(path, space="space")
    k = np.array([[2], [8]])
    [first] = space.relation_covs(space.between(*one.poses_world[k]), one.pair_covs(*k))
    assert found.covs[1] == pytest.approx(first)
    motions = (helix(30)[2:3], helix(30)[8:9]), (one.poses_world[2:3], one.poses_world[8:9])
    true, estimated = (matrix(space.between(*each)[0]) for each in motions)
    assert found.errors[1, :3] == pytest.approx((np.linalg.inv(true) @ estimated)[:3, 3], abs=1e-12)
    turned = vee(logm(np.linalg.inv(true) @ estimated))[3:]
    assert found.errors[1, 3:] == pytest.approx(turned, abs=1e-9)


def test_triangles_in_space_tell_the_error_of_relations(tmp_path):
    rng, kept, right = np.random.default_rng(1), [], []
    sigmas = np.array([0.03, 0.03, 0.03, 0.01, 0.01, 0.01])
    for _ in range(12):
        times, motions = [], []
        for group in range(20):
            poses = np.array([pose(rng.uniform(-2, 2, 3), rng.uniform(-1, 1, 3)) for _ in range(4)])
            ends = [(i, j) for i in range(4) for j in range(i + 1, 4)]
            times += [(10.0 * group + i, 10.0 * group + j) for i, j in ends]
            motions.append(relations_of(poses, ends, sigmas, rng))
        path = relations_written(tmp_path / "r", np.array(times), np.concatenate(motions))
        [found] = audit([], relations=path, space="space").without_truth
        metres, _, radians, _ = found.told.subject.removeprefix("sigma ").split(",")[0].replace(" and", "").split()
        kept.append((float(metres), float(radians)))
        right.append(audit([], relations=path, space="space", reference_sigma=(0.03, 0.01)).without_truth[0])
        [half] = audit([], relations=path, space="space", reference_sigma=(0.015, 0.005)).without_truth
        assert half.verdict.words == OVERCONFIDENT
        assert half.verdict.factor == pytest.approx(2.0, rel=0.2)
    assert np.mean(kept, axis=0) == pytest.approx([0.03, 0.01], rel=0.03)
    assert rejected(map(Interval, right)) <= 3


def test_graphs_of_the_other_space_and_lone_options_are_refused_in_one_line(tmp_path):
    path, true, _, _ = drive(tmp_path, count=14)
    (tmp_path / "flat.g2o").write_text("VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 0 0 0\n")
    (tmp_path / "bad.g2o").write_text("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 0 0 0 0 0 0 3\n")
    for words, told in (
        ((path, {}), "found VERTEX_SE3:QUAT, EDGE_SE3:QUAT: --space space reads graphs in space"),
        ((tmp_path / "flat.g2o", {"space": "space"}), "found VERTEX_SE2: leave --space out"),
        ((tmp_path / "bad.g2o", {"space": "space"}), "length 3 in the lines of VERTEX_SE3:QUAT, line 2"),
        ((path, {"g2o_rotation": "vector"}), "expected --g2o-rotation beside --space space"),
    ):
        with pytest.raises(chainslam.UsageError) as found:
            audit(words[0], truth=true, **words[1])
        assert told in str(found.value)
        assert "\n" not in str(found.value)
