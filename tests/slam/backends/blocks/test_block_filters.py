"""A map of blocks is the dense Gaussian of which all else is dropped; the paper's filter against plain loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.backends.blocks.block_ekf import BlockEkf
from chainslam.slam.backends.blocks.block_map import BlockMap
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.estimation.models import Initialisation, Linear, Motion, innovations
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.robot import Odometry

few = settings(max_examples=15, deadline=None, derandomize=True)
START, P0 = np.array([0.2, -1.0, 3.1]), np.diag([0.02, 0.02, 0.01]) ** 2
NONE = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))

pytestmark = pytest.mark.usefixtures("_unchecked")


def blocks_of(P):
    """Return what is left of a covariance of pose and lines without cross-covariances."""
    parts = np.concatenate([np.zeros(3), 1 + np.arange(len(P) - 3) // 2])
    return np.where(parts[:, None] == parts, P, 0.0)


@few
@given(seed=st.integers(0, 2**32))
def test_every_verb_is_that_of_the_dense_gaussian_without_cross_covariances(seed):
    rng, ids, anchors = np.random.default_rng(seed), [], np.zeros((0, 2))
    root = rng.standard_normal((3, 3))
    map_, x, P, entered = BlockMap(START, root @ root.T), START.copy(), root @ root.T, 0
    for _ in range(40):
        n, verb = len(map_.ids), rng.choice(["move", "append", "drop", "condition", "relocate", "put"])
        A, noise = np.eye(len(P)), np.zeros_like(P)
        if verb == "move":
            pose, A[:3, :3], noise[:3, :3] = rng.uniform(-3, 3, 3), rng.standard_normal((3, 3)), 0.1 * np.eye(3)
            map_.move(Motion(pose, A[:3, :3], np.eye(3)), noise[:3, :3])
            x[:3], P = pose, A @ P @ A.T + noise
        elif verb == "append":
            m = int(rng.integers(0, 4))
            G, places, means = rng.standard_normal((m, 2, 3)), rng.uniform(-1, 1, (m, 2)), rng.uniform(-3, 3, (m, 2))
            new = map_.append(Initialisation(places, means, G, np.zeros((m, 2, 2))), np.tile(np.eye(2), (m, 1, 1)))
            assert new.tolist() == list(range(entered, entered + m))
            ids, anchors, entered = ids + new.tolist(), np.vstack([anchors, places]), entered + m
            A = np.vstack([A, np.zeros((2 * m, len(P)))])
            A[len(P) :, :3] = G.reshape(-1, 3)
            x, P = np.concatenate([x, means.ravel()]), A @ P @ A.T
            P[np.arange(len(P)) >= len(P) - 2 * m, np.arange(len(P)) >= len(P) - 2 * m] += 1.0
        elif n and verb == "drop":
            rows = rng.choice(n, int(rng.integers(1, n + 1)), replace=False)
            map_.drop(rows)
            gone = np.concatenate([3 + 2 * rows, 4 + 2 * rows])
            x, P, anchors = np.delete(x, gone), np.delete(np.delete(P, gone, 0), gone, 1), np.delete(anchors, rows, 0)
            ids = np.delete(ids, rows).astype(int).tolist()
        elif n and verb in ("condition", "relocate"):
            rows = rng.permutation(n)[: rng.integers(1, min(n, 4) + 1)]
            columns = np.concatenate([[0, 1, 2], (3 + 2 * rows[:, None] + np.arange(2)).ravel()])
            H, e, R = np.zeros((4, len(x))), rng.standard_normal(4), 0.1 * np.eye(4)
            H[:, columns] = rng.standard_normal((4, len(columns)))
            S = H @ P @ H.T + R
            gain = P @ H.T @ np.linalg.inv(S)
            if verb == "relocate":
                gain[3:] = 0.0
            getattr(map_, verb)(Linear(rows, H[:, columns], e, R))
            rest = np.eye(len(x)) - gain @ H
            x, P = x + gain @ e, rest @ P @ rest.T + gain @ R @ gain.T
        elif n and verb == "put":
            rows, means = rng.permutation(n)[:2], rng.uniform(-9, 9, (2, 2))[:n]
            P[3 + 2 * rows[0] : 5 + 2 * rows[0], 3 + 2 * rows[0] : 5 + 2 * rows[0]] = [[2.0, 0.5], [0.5, 1.0]]
            before = map_.means, map_.covs
            kept = [part.copy() for part in before]
            covs = map_.covs[rows]
            covs[0] = [[2.0, 1.0], [0.0, 1.0]]
            map_.put(rows, means.copy(), covs)
            np.testing.assert_array_equal(before[0], kept[0])
            np.testing.assert_array_equal(before[1], kept[1])
            for row, mean in zip(rows, means, strict=True):
                x[3 + 2 * row : 5 + 2 * row] = mean
        P = blocks_of(P)
        if verb in ("condition", "relocate", "put"):
            x[2] = wrap(x[2]) if verb != "put" else x[2]
            x[3::2] = wrap(x[3::2])
        joint, scale = map_.joint(np.arange(len(map_.ids))), np.abs(P).max()
        assert map_.ids.dtype == np.int64
        assert map_.ids.tolist() == ids
        np.testing.assert_array_equal(joint.anchors, anchors)
        np.testing.assert_allclose(np.exp(1j * (joint.mean - x)), 1.0, atol=1e-9 * max(1.0, np.abs(x).max()))
        np.testing.assert_allclose(joint.mean[[2, *range(3, len(x), 2)]], x[[2, *range(3, len(x), 2)]], atol=1e-6)
        np.testing.assert_allclose(joint.cov, P, atol=1e-9 * scale)
        np.testing.assert_array_equal(joint.cov, joint.cov.T)
        some = rng.permutation(len(ids))[:2]
        np.testing.assert_array_equal(map_.joint(some).mean[3:], map_.means[some].ravel())


def test_a_pose_of_whole_numbers_becomes_one_of_fractions():
    map_ = BlockMap(np.array([1, 2, 0]), np.eye(3, dtype=np.int64))
    assert map_.pose_world.dtype == map_.pose_cov.dtype == np.float64


def paper(map_, first, second):
    """Move the pose by `first`, then fuse each of `second` with its own line; return pose, its covariance and lines."""
    joint = map_.joint(np.arange(len(map_.ids)))
    pose, P = joint.mean[:3], joint.cov[:3, :3]
    means, covs = joint.mean[3:].reshape(-1, 2).copy(), map_.covs.copy()

    def look(row, line, cov):
        model = innovations(pose, map_.anchors[[row]], means[[row]], line[None], cov[None])
        return model.e[0], model.H_pose[0], model.H_line[0], model.R[0]

    if len(first.ids):
        H, e, R = np.zeros((2 * len(first), len(joint.mean))), np.zeros(2 * len(first)), np.zeros((2 * len(first),) * 2)
        for k, (row, line, cov) in enumerate(zip(first.ids, first.lines, first.cov, strict=True)):
            at = slice(2 * k, 2 * k + 2)
            e[at], H[at, :3], H[at, 3 + 2 * row : 5 + 2 * row], R[at, at] = look(row, line, cov)
        S = H @ joint.cov @ H.T + R
        gain = joint.cov[:3, :3] @ H[:, :3].T @ np.linalg.inv(S)
        pose, P = pose + gain @ e, P - gain @ S @ gain.T
    for row, line, cov in zip(second.ids, second.lines, second.cov, strict=True):
        e, H_pose, H_line, R = look(row, line, cov)
        back = np.linalg.inv(H_line)
        C2 = back @ (H_pose @ P @ H_pose.T + R) @ back.T
        C = np.linalg.inv(np.linalg.inv(covs[row]) + np.linalg.inv(C2))
        means[row], covs[row] = means[row] + C @ np.linalg.solve(C2, back @ e), C
    return pose, P, means, covs


@pytest.mark.parametrize(("first", "second"), [(1, 1), (1, 0), (0, 1)], ids=str)
def test_the_papers_filter_relocates_by_all_first_matches_and_fuses_each_line_as_often_as_it_was_seen(
    first, second, make_walls
):
    rng, walls = np.random.default_rng(31), make_walls(6)
    backend = BlockEkf(START, P0, EkfConfig())
    ids = backend.grow(*walls.look(START, np.arange(6), rng))
    backend.predict(Odometry(np.array([0.1, 0.0, 0.05]), np.diag([0.02, 0.02, 0.02]) ** 2))
    rows = np.array([4, 1, 4, 0, 1, 4])
    lines, cov, _ = walls.look(START + np.array([-0.1, 0.02, 0.04]), rows, rng)
    seen = [Observations(ids[rows], lines, cov), Observations(ids[rows[1:]], lines[1:], cov[1:])]
    told = [each if wanted else NONE for each, wanted in zip(seen, (first, second), strict=True)]
    pose, P, means, covs = paper(backend.map, *told)
    belief = backend.belief
    backend.update(*told)
    after = backend.belief.joint(ids)
    np.testing.assert_allclose(after.mean[:3], pose, atol=1e-12)
    np.testing.assert_allclose(after.cov[:3, :3], P, atol=1e-15)
    np.testing.assert_allclose(after.mean[3:], means.ravel(), atol=1e-12)
    np.testing.assert_allclose(after.cov[3:, 3:], blocks_of(np.pad(after.cov[3:, 3:], (3, 0)))[3:, 3:])
    for k, block in enumerate(covs):
        np.testing.assert_allclose(after.cov[3 + 2 * k : 5 + 2 * k, 3 + 2 * k : 5 + 2 * k], block, atol=1e-15)
    assert backend.belief is not belief
    belief = backend.belief
    backend.update(NONE, NONE)
    assert backend.belief is belief
