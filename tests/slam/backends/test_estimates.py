"""Estimates of back ends that keep the correlations: the batch solution where all is linear, and honest errors."""

import jaxtyping
import numpy as np
import pytest

from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.evaluation.consistency import joint_error, nees, pose_covariances, pose_errors
from chainslam.slam.geometry.poses import arc, compose, wrap
from chainslam.slam.robot import Odometry

RUNS = 60

pytestmark = [
    pytest.mark.parametrize("name", [name for name, entry in BACKENDS.items() if entry.covariance == "exact"]),
    pytest.mark.usefixtures("_unchecked"),
]


@pytest.fixture
def _unchecked():
    """Without the shape checks that pytest adds, which the contract's tests keep."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def normal(alpha):
    return np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)


def test_the_last_estimate_is_the_batch_solution_where_headings_are_known(name):
    """Unknown: every place and every line's offset. With all angles known the whole problem is linear."""
    rng, tiny, steps = np.random.default_rng(31), 1e-9, 12
    alpha = np.array([0.3, 1.9, -2.4, -0.9, 2.7])
    r = rng.uniform(2, 4, 5)
    sigma_r, sigma_p, sigma_odo = 0.01, 0.05, 0.03
    true, heading = np.array([0.2, -0.1]), 0.5
    start = true + sigma_p * rng.standard_normal(2)
    backend = BACKENDS[name].make(np.append(start, heading), np.diag([sigma_p, sigma_p, tiny]) ** 2)
    # Rows (index of place, its coefficients, index of line, its coefficient, value, sigma) of the batch problem.
    rows = [np.array([[0, 1, 0, -1, 0, start[0], sigma_p], [0, 0, 1, -1, 0, start[1], sigma_p]])]
    links = []
    ids: dict[int, int] = {}
    for k in range(steps):
        if k:
            turn = rng.uniform(-0.3, 0.3)
            moved = np.array([0.3, 0.05])
            c, s = np.cos(heading), np.sin(heading)
            step_world = np.array([[c, -s], [s, c]]) @ moved
            true = true + step_world + sigma_odo * rng.standard_normal(2)
            backend.predict(Odometry(np.append(moved, turn), np.diag([sigma_odo, sigma_odo, tiny]) ** 2))
            heading += turn
            links.append((k, step_world))
        seen = rng.choice(5, 3, replace=False)
        lines = np.stack([wrap(alpha[seen] - heading), r[seen] - normal(alpha[seen]) @ true], axis=-1)
        lines[:, 1] += sigma_r * rng.standard_normal(3)
        cov = np.repeat(np.diag([tiny**2, sigma_r**2])[None], 3, axis=0)
        for i, line in zip(seen, lines, strict=True):
            rows.append(np.array([[k, *-normal(alpha[i]), i, 1, line[1], sigma_r]]))
        old = np.array([j for j, i in enumerate(seen) if i in ids], dtype=np.int64)
        new = np.array([j for j, i in enumerate(seen) if i not in ids], dtype=np.int64)
        if len(old):
            observed = Observations(np.array([ids[seen[j]] for j in old]), lines[old], cov[old])
            backend.update(observed, observed)
        if len(new):
            grown = backend.grow(lines[new], cov[new], lines[new, 1:] * normal(lines[new, 0]))
            ids.update(zip(seen[new].tolist(), grown.tolist(), strict=True))
    A, b = np.zeros((0, 2 * steps + 5)), np.zeros(0)
    for k, px, py, i, q, value, sigma in np.concatenate(rows):
        row = np.zeros(2 * steps + 5)
        row[2 * int(k) : 2 * int(k) + 2] = px, py
        if i >= 0:
            row[2 * steps + int(i)] = q
        A, b = np.vstack([A, row / sigma]), np.append(b, value / sigma)
    for k, step_world in links:
        row = np.zeros((2, 2 * steps + 5))
        row[:, 2 * k : 2 * k + 2], row[:, 2 * k - 2 : 2 * k] = np.eye(2), -np.eye(2)
        A, b = np.vstack([A, row / sigma_odo]), np.append(b, step_world / sigma_odo)
    solution, *_ = np.linalg.lstsq(A, b, rcond=None)
    cov = np.linalg.inv(A.T @ A)
    order = sorted(ids)
    index = np.array([2 * steps - 2, 2 * steps - 1, *(2 * steps + i for i in order)])
    belief = backend.belief
    wanted = np.array([ids[i] for i in order])
    joint = belief.joint(wanted)
    mine = np.array([0, 1, *(4 + 2 * j for j in range(len(order)))])
    anchors = np.sum(normal(alpha[order]) * joint.anchors, axis=-1)
    np.testing.assert_allclose(joint.mean[:2], solution[index[:2]], atol=1e-9)
    np.testing.assert_allclose(joint.mean[mine[2:]] + anchors, solution[index[2:]], atol=1e-9)
    np.testing.assert_allclose(joint.cov[np.ix_(mine, mine)], cov[np.ix_(index, index)], atol=1e-12)


LINES = np.array([[0.0, 3.0], [np.pi / 2, 2.5], [-np.pi, 3.0], [-np.pi / 2, 2.5], [0.7, 3.6], [2.5, 3.4], [-2.2, 3.3]])
SEEN_AT = np.array([0.5, -0.4, -0.8, 0.2, 0.0, 0.6, -0.5])
"""Where along each line its middle is seen, m from the foot of the origin's perpendicular."""
SIGMAS = np.array([0.004, 0.004])
P0 = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2


def look(pose, rows, rng):
    """Draw observations from the exact model: an angle error turns the line about the seen piece's centre."""
    alpha = LINES[rows, 0]
    n, t = normal(alpha), np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1)
    points = LINES[rows, 1:] * n + SEEN_AT[rows, None] * t
    true_r = np.sum(n * (points - pose[:2]), axis=-1)
    t0 = np.sum(t * (points - pose[:2]), axis=-1)
    turn = np.repeat(np.eye(2)[None], len(rows), axis=0)
    turn[:, 1, 0] = t0
    error = np.einsum("mij,mj->mi", turn * SIGMAS, rng.standard_normal((len(rows), 2)))
    lines = np.stack([wrap(alpha - pose[2] + error[:, 0]), true_r + error[:, 1]], axis=-1)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    centres = (points - pose[:2]) @ np.array([[c, -s], [s, c]])
    return lines, (turn * SIGMAS**2) @ turn.swapaxes(1, 2), centres


def run(name, seed, steps=12):
    """Drive a circle from a start that is wrong by a draw from P0; return pose NEES per step and the map's."""
    rng = np.random.default_rng([77, seed])
    true = np.array([0.0, -1.0, 0.0])
    backend = BACKENDS[name].make(true + np.sqrt(np.diag(P0)) * rng.standard_normal(3), P0.copy())
    odo_cov = np.diag([0.01, 0.004, 0.012]) ** 2
    motion, ids, errors = arc(0.15, 0.15), {}, []
    for _ in range(steps):
        backend.predict(Odometry(motion, odo_cov))
        true = compose(true, motion + np.linalg.cholesky(odo_cov) @ rng.standard_normal(3))
        rows = rng.choice(len(LINES), 4, replace=False)
        lines, cov, centres = look(true, rows, rng)
        old = np.array([k for k, row in enumerate(rows) if row in ids], dtype=np.int64)
        new = np.array([k for k, row in enumerate(rows) if row not in ids], dtype=np.int64)
        if len(old):
            observed = Observations(np.array([ids[rows[k]] for k in old]), lines[old], cov[old])
            backend.update(observed, observed)
        if len(new):
            grown = backend.grow(lines[new], cov[new], centres[new])
            ids.update(zip(rows[new].tolist(), grown.tolist(), strict=True))
        belief = backend.belief
        error = pose_errors(belief.pose_world[None], true[None])
        errors.append(nees(error, pose_covariances(belief.pose_world[None], belief.pose_cov[None]))[0])
    rows = sorted(ids)
    error, cov = joint_error(backend.belief.joint([ids[row] for row in rows]), true, LINES[rows])
    return np.mean(errors), nees(error[None], cov[None])[0] / len(error)


def test_pose_and_map_errors_are_as_large_as_their_covariances_say(name):
    pose, both = np.array([run(name, seed) for seed in range(RUNS)]).T
    assert abs(pose.mean() / 3 - 1.0) < 3 * 0.75 / np.sqrt(RUNS)
    dimension = 3 + 2 * len(LINES)
    assert abs(both.mean() - 1.0) < 4 * np.sqrt(2 / dimension / RUNS)
