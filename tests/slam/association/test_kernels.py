"""The loops of matching against dense algebra and plain geometry, pair by pair."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.association.kernels.candidate_kernels import Known, Limits, Seen, candidates
from chainslam.slam.association.kernels.joint_kernels import taken_together
from chainslam.slam.geometry.poses import wrap

few = settings(max_examples=40, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
LIMITS = Limits(9.21, 27.6, 18.4, 0.5, 0.02, 0.35, 0.1, 0.08, 0.3, 0.5)


def scene(seed):
    """Return segments and walls, some of which lie along each other, about a robot."""
    rng = np.random.default_rng(seed)
    pose, n = rng.uniform(-3.0, 3.0, 3), rng.integers(1, 7)
    alpha = rng.uniform(-np.pi, np.pi, n)
    normal = np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)
    anchors = pose[:2] + rng.uniform(0.5, 3.0, (n, 1)) * normal + rng.uniform(-0.5, 0.5, (n, 2))
    mean = np.concatenate([pose, np.column_stack([alpha, rng.uniform(-0.2, 0.2, n)]).ravel()])
    root = rng.standard_normal((len(mean), len(mean)))
    cov = 1e-4 * (root @ root.T + np.eye(len(mean)))
    start = rng.uniform(-1.0, 0.0, n)
    known = Known(mean, cov, anchors, np.stack([start, start + rng.uniform(0.1, 1.0, n)], axis=-1))
    of = rng.integers(0, n, rng.integers(0, 6))
    turned = alpha[of] - pose[2] + rng.normal(0.0, 0.1, len(of))
    r = np.maximum(np.vecdot(normal, anchors - pose[:2])[of] + mean[4::2][of] + rng.normal(0.0, 0.1, len(of)), 0.1)
    towards, beside = np.stack([np.cos(turned), np.sin(turned)], -1), np.stack([-np.sin(turned), np.cos(turned)], -1)
    along = np.sort(rng.uniform(-1.0, 1.0, (len(of), 2)), axis=1)
    ends = r[:, None, None] * towards[:, None] + along[..., None] * beside[:, None]
    # Independent at the middle of the piece: in (alpha, r) the direction moves r by so much.
    lever = np.tile(np.eye(2), (len(of), 1, 1))
    lever[:, 1, 0] = along.mean(axis=1)
    spread = lever @ np.diag([0.02, 0.01]) ** 2 @ lever.swapaxes(1, 2)
    return Seen(np.stack([turned, r], axis=-1), spread, ends, np.zeros(len(of), bool)), known


def innovation(state, anchor, line, t0):
    """Return turn and offset of the middle of a seen piece from a line of the map; `state` is that of pose and line."""
    x, y, heading, alpha, d = state
    turn = wrap(line[0] + heading - alpha)
    middle = line[1] * np.array([np.cos(turn), np.sin(turn)]) + t0 * np.array([-np.sin(turn), np.cos(turn)])
    n = np.array([np.cos(alpha), np.sin(alpha)])
    return np.array([turn, middle[0] - (d + n @ (anchor - [x, y]))])


@few
@given(seed=seeds)
def test_pairs_and_their_distances_are_those_of_plain_geometry(seed):
    """The Jacobian is that by differences of what is predicted once the heading has made up for half its share."""
    seen, known = scene(seed)
    found, expected = candidates(seen, known, LIMITS), []
    pose = known.mean[:3]
    for s, line in enumerate(seen.lines):
        for n, anchor in enumerate(known.anchors):
            at = 3 + 2 * n
            columns = np.array([0, 1, 2, at, at + 1])
            state, cov = known.mean[columns], known.cov[np.ix_(columns, columns)]
            alpha, C = state[3], seen.cov[s]
            if np.cos(line[0] + pose[2] - alpha) <= 0.5:
                continue
            t0 = C[0, 1] / C[0, 0]
            e = innovation(state, anchor, line, t0)
            turning = np.array([0.0, 0.0, 1.0, -1.0, 0.0])
            own = turning @ cov @ turning
            half = np.zeros(5)
            half[2] = 0.5 * e[0] * own / (own + C[0, 0])
            steps = 1e-6 * np.eye(5)
            H = np.stack(
                [innovation(state - half + d, anchor, line, t0) - innovation(state - half - d, anchor, line, t0)
                 for d in steps], axis=-1
            ) / 2e-6  # fmt: skip
            shortened = np.cos(e[0]) - t0 / line[1] * np.sin(e[0])
            R = np.diag([C[0, 0], (C[1, 1] - C[0, 1] * t0) * shortened**2])
            d2 = e @ np.linalg.solve(H @ cov @ H.T + R, e)
            turn = np.array([[np.cos(pose[2]), -np.sin(pose[2])], [np.sin(pose[2]), np.cos(pose[2])]])
            low, high = (seen.ends[s] @ turn.T + pose[:2] - anchor) @ np.array([-np.sin(alpha), np.cos(alpha)])
            begin, end = known.extents[n]
            if abs(e[1]) < 0.5 or d2 <= 27.6:
                expected.append((s, n, d2, max(low - end, begin - high)))
    assert list(zip(found.segment.tolist(), found.line.tolist(), strict=True)) == [pair[:2] for pair in expected]
    np.testing.assert_allclose(found.d2, [pair[2] for pair in expected], rtol=1e-5)
    np.testing.assert_allclose(found.gap, [pair[3] for pair in expected], atol=1e-12)


@few
@given(seed=seeds)
def test_observations_taken_together_have_the_covariance_of_one_dense_jacobian(seed):
    seen, known = scene(seed)
    found = candidates(seen, known, LIMITS)
    count = len(found.line)
    H, R = np.zeros((2 * count, len(known.mean))), np.zeros((2 * count, 2 * count))
    for k, line in enumerate(found.line):
        rows = slice(2 * k, 2 * k + 2)
        H[rows, :3], H[rows, 3 + 2 * line : 5 + 2 * line], R[rows, rows] = found.H_pose[k], found.H_line[k], found.R[k]
    PHt, S = taken_together(known.cov, found.line, found.H_pose, found.H_line, found.R)
    np.testing.assert_allclose(PHt, known.cov @ H.T, atol=1e-15)
    np.testing.assert_allclose(S, H @ known.cov @ H.T + R, atol=1e-15)
