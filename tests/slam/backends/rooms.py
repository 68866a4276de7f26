"""A room of lines and a noisy drive through it, from which any back end of the registry can be fed."""

from dataclasses import dataclass

import numpy as np

from slam.backends import BACKENDS
from slam.estimation.backend import Backend, Observations
from slam.geometry.poses import compose, wrap
from slam.robot import Odometry

NOWHERE = np.zeros(3)
START, P0 = np.array([0.5, -0.3, 0.2]), np.diag([0.01, 0.01, 0.002]) ** 2


def normal(alpha):
    return np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)


@dataclass
class Room:
    """True lines (alpha, r) with the points where they are looked at, and a robot that drives in a circle."""

    lines: np.ndarray
    points: np.ndarray

    @classmethod
    def random(cls, rng, count=8):
        alpha = rng.uniform(-np.pi, np.pi, count)
        r = rng.uniform(2.0, 6.0, count)
        along = np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1)
        return cls(np.stack([alpha, r], axis=-1), r[:, None] * normal(alpha) + rng.uniform(-1, 1, (count, 1)) * along)

    def seen(self, pose, rows, rng=None):
        """Return lines, covariances and centres in the robot frame, noisy with a generator."""
        alpha = self.lines[rows, 0] - pose[2]
        r = self.lines[rows, 1] - normal(self.lines[rows, 0]) @ pose[:2]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        centres = (self.points[rows] - pose[:2]) @ np.array([[c, -s], [s, c]])
        t0 = np.sum(centres * np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1), axis=-1)
        turn = np.zeros((len(rows), 2, 2))
        turn[:, 0, 0] = turn[:, 1, 1] = 1.0
        turn[:, 1, 0] = t0
        cov = turn @ np.diag([0.004**2, 0.003**2]) @ turn.swapaxes(1, 2)
        lines = np.stack([wrap(alpha), r], axis=-1)
        if rng is not None:
            lines = lines + np.einsum("mij,mj->mi", np.linalg.cholesky(cov), rng.standard_normal((len(rows), 2)))
        return lines, cov, centres


def odometry(rng, forward=0.1, turn=0.15):
    cov = np.diag([0.01, 0.005, 0.008]) ** 2
    return Odometry(np.array([forward, 0.0, turn]), cov), cov


def see(backend: Backend, ids, lines, cov):
    observed = Observations(np.asarray(ids, dtype=np.int64), lines, cov)
    backend.update(observed, observed)


def everything(backend):
    return backend.belief.joint(backend.belief.ids)


def volume(backend):
    """Return the log of the uncertainty's volume, which no change of the error's coordinates alters."""
    return np.linalg.slogdet(everything(backend).cov)[1]


def assert_sound(backend):
    """The joint covariance is symmetric and positive definite, and says what the belief says."""
    belief = backend.belief
    joint = belief.joint(belief.ids)
    P = joint.cov
    np.testing.assert_allclose(P, P.T, rtol=0, atol=1e-14 * np.abs(P).max())
    scale = np.sqrt(np.diag(P))
    assert np.all(scale > 0)
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 0
    np.testing.assert_array_equal(joint.mean[:3], belief.pose_world)
    np.testing.assert_array_equal(joint.mean[3:].reshape(-1, 2), belief.means)
    np.testing.assert_array_equal(P[:3, :3], belief.pose_cov)
    np.testing.assert_array_equal(joint.anchors, belief.anchors)


def journey(name, room, steps, rng, start=START, world=NOWHERE, order=lambda rows: rows):
    """Drive a noisy circle through a room whose observations do not depend on where `world` puts it.

    Every line is entered when first seen; two to five lines are seen in each step.
    """
    backend = BACKENDS[name].make(compose(world, start), rotated(P0, world[2]))
    true, ids = start.copy(), {}
    for _ in range(steps):
        odo, cov = odometry(rng)
        true = compose(true, odo.motion + np.linalg.cholesky(cov) @ rng.standard_normal(3))
        backend.predict(odo)
        rows = np.sort(rng.choice(len(room.lines), rng.integers(2, 6), replace=False))
        lines, covs, centres = room.seen(true, rows, rng)
        known = order(np.array([k for k, row in enumerate(rows) if row in ids], dtype=np.int64))
        if len(known):
            see(backend, [ids[rows[k]] for k in known], lines[known], covs[known])
        new = np.array([k for k, row in enumerate(rows) if row not in ids], dtype=np.int64)
        if len(new):
            grown = backend.grow(lines[new], covs[new], centres[new])
            ids.update(zip(rows[new].tolist(), grown.tolist(), strict=True))
    return backend, true, ids


def rotated(P, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ P @ turn.T
