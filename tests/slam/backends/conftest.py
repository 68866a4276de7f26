"""Observations of lines drawn straight from the model, with known association, for tests of filters."""

from dataclasses import dataclass

import numpy as np
import pytest

from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.poses import arc, compose, wrap
from chainslam.slam.robot import Odometry


def normal(alpha):
    return np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)


@dataclass
class Walls:
    """True lines (alpha, r) and the points where they are looked at."""

    lines: np.ndarray
    points: np.ndarray
    sigmas: np.ndarray

    def look(self, pose, rows, rng=None):
        """Return lines, covariances and seen centres in the robot frame; an angle error turns about the centre."""
        alpha, n = self.lines[rows, 0], normal(self.lines[rows, 0])
        t, away = np.stack([-n[:, 1], n[:, 0]], axis=-1), self.points[rows] - pose[:2]
        turn = np.tile(np.eye(2), (len(rows), 1, 1))
        turn[:, 1, 0] = np.sum(t * away, axis=-1)
        lines = np.stack([wrap(alpha - pose[2]), np.sum(n * away, axis=-1)], axis=-1)
        if rng is not None:
            lines = lines + np.einsum("mij,mj->mi", turn * self.sigmas, rng.standard_normal((len(rows), 2)))
        c, s = np.cos(pose[2]), np.sin(pose[2])
        return lines, (turn * self.sigmas**2) @ turn.swapaxes(1, 2), away @ np.array([[c, -s], [s, c]])

    def tour(self, backend, true, rng, steps, ids=None, seen=5, sigmas=(0.01, 0.005, 0.01)):
        """Drive a noisy circle and yield the true pose after every step.

        In each a few lines are seen; a line that is not in `ids` (wall to id) is entered when first seen.
        """
        motion, cov = arc(0.15, 0.1), np.diag(sigmas) ** 2
        ids = {} if ids is None else ids
        for _ in range(steps):
            backend.predict(Odometry(motion, cov))
            true = compose(true, motion + np.asarray(sigmas) * rng.standard_normal(3))
            rows = rng.choice(len(self.lines), seen, replace=False)
            lines, covs, centres = self.look(true, rows, rng)
            old = np.array([k for k, row in enumerate(rows) if row in ids], dtype=np.int64)
            new = np.array([k for k, row in enumerate(rows) if row not in ids], dtype=np.int64)
            if len(old):
                found = Observations(np.array([ids[rows[k]] for k in old]), lines[old], covs[old])
                backend.update(found, found)
            if len(new):
                grown = backend.grow(lines[new], covs[new], centres[new])
                ids.update(zip(rows[new].tolist(), grown.tolist(), strict=True))
            yield true


@pytest.fixture
def make_walls():
    """Return how to make `count` walls around the origin."""

    def make(count=16, sigmas=(0.004, 0.004), seed=3):
        rng = np.random.default_rng(seed)
        alpha, r = wrap(np.linspace(-3.1, 2.9, count)), rng.uniform(2.5, 4.5, count)
        along = np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1)
        points = r[:, None] * normal(alpha) + rng.uniform(-1.0, 1.0, (count, 1)) * along
        return Walls(np.stack([alpha, r], axis=-1), points, np.asarray(sigmas))

    return make
