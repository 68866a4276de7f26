"""Relocation, then fusion: two gains on the errors before, and the noise that both have in common."""

import numpy as np
import pytest

from chainslam.slam.backends.relocation_ekf import RelocationEkf
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.estimation.models import innovations
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.robot import Odometry

START, P0 = np.array([0.2, -1.0, 3.1]), np.diag([0.02, 0.02, 0.01]) ** 2
NONE = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))

pytestmark = pytest.mark.usefixtures("_unchecked")


def looked(joint, pose, seen):
    """Return e, H and R of observations, by the whole state, seen from a pose."""
    m = len(seen.ids)
    e, H, R = np.zeros(2 * m), np.zeros((2 * m, len(joint.mean))), np.zeros((2 * m, 2 * m))
    for k, row in enumerate(seen.ids.tolist()):
        at, line = slice(2 * k, 2 * k + 2), slice(3 + 2 * row, 5 + 2 * row)
        one = innovations(pose, joint.anchors[[row]], joint.mean[line][None], seen.lines[[k]], seen.cov[[k]])
        e[at], H[at, :3], H[at, line], R[at, at] = one.e[0], one.H_pose[0], one.H_line[0], one.R[0]
    return e, H, R


def plain(joint, first, second):
    """Return mean and covariance after both steps: the errors dx become dx - K (H dx + v).

    K has what the first ones move the pose by, and the second ones the lines.

    v is the noise of both steps, and that of an observation that was in both is the same, in units of its sigmas.
    """
    P, pose = joint.cov, joint.mean[:3]
    e1, H1, R1 = looked(joint, pose, first)
    A = (P @ H1.T @ np.linalg.inv(H1 @ P @ H1.T + R1))[:3]
    moved = pose + A @ e1
    e2, H2, R2 = looked(joint, moved, second)
    e2 = e2 + H2[:, :3] @ (moved - pose)
    B = P @ H2.T @ np.linalg.inv(H2 @ P @ H2.T + R2)
    n1, n2 = len(e1), len(e2)
    K, R = np.zeros((len(P), n1 + n2)), np.zeros((n1 + n2, n1 + n2))
    K[:3, :n1], K[3:, n1:] = A, B[3:]
    R[:n1, :n1], R[n1:, n1:] = R1, R2
    for i, mine in enumerate(first.lines):
        for j, theirs in enumerate(second.lines):
            if np.array_equal(mine, theirs):
                for k in range(2):
                    common = np.sqrt(R1[2 * i + k, 2 * i + k] * R2[2 * j + k, 2 * j + k])
                    R[2 * i + k, n1 + 2 * j + k] = R[n1 + 2 * j + k, 2 * i + k] = common
    rest = np.eye(len(P)) - K @ np.vstack([H1, H2])
    return joint.mean + K @ np.concatenate([e1, e2]), rest @ P @ rest.T + K @ R @ K.T


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "parts",
    [(slice(0, 4), slice(1, 6)), (slice(6), slice(6)), (slice(0), slice(6)), (slice(6), slice(0))],
    ids=["some", "all", "second", "first"],
)
def test_pose_and_lines_are_corrected_by_their_own_gains_and_no_noise_counts_twice(seed, parts, make_walls):
    """A heading that passes half a turn, and an observation that was matched otherwise when it was seen again."""
    rng, walls = np.random.default_rng(seed), make_walls(6)
    backend = RelocationEkf(START, P0)
    ids = backend.grow(*walls.look(START, np.arange(6), rng))
    for turn in range(3):
        backend.predict(Odometry(np.array([0.05, 0.0, 0.06]), np.diag([0.03, 0.03, 0.03]) ** 2))
        rows = rng.permutation(np.append(np.arange(5), 2))
        true = backend.belief.pose_world + 0.02 * rng.standard_normal(3)
        lines, cov, _ = walls.look(true, rows, rng)
        both = rows.copy()
        if turn == 1:
            both[0] = both[1]
        first = Observations(ids[rows[parts[0]]], lines[parts[0]], cov[parts[0]])
        second = Observations(ids[both[parts[1]]], lines[parts[1]], cov[parts[1]])
        joint = backend.belief.joint(ids)
        mean, P = plain(joint, first, second)
        mean[2], mean[3::2] = wrap(mean[2]), wrap(mean[3::2])
        backend.update(first, second)
        after = backend.belief.joint(ids)
        np.testing.assert_allclose(after.mean, mean, atol=1e-9)
        np.testing.assert_allclose(after.cov, P, atol=1e-9 * np.abs(P).max())
        np.testing.assert_array_equal(after.cov, after.cov.T)


def test_nothing_seen_is_nothing_done(make_walls):
    backend = RelocationEkf(START, P0)
    belief = backend.belief
    backend.update(NONE, NONE)
    assert backend.belief is belief
