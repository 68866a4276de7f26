"""A recorded drive with known association, its dense least-squares solution, and how far two answers agree."""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy.optimize import least_squares

from chainslam.slam.estimation.backend import Observations
from chainslam.slam.estimation.models import innovations, lines_robot
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import compose, inverse, to_robot, wrap
from chainslam.slam.robot import Odometry

P0 = np.array([[4e-4, 5e-5, 1e-5], [5e-5, 3e-4, -2e-5], [1e-5, -2e-5, 1e-4]])
ODOMETRY_COV = np.array([[1e-4, 2e-5, 3e-5], [2e-5, 4e-5, 1e-5], [3e-5, 1e-5, 2e-4]])
START = np.array([3.0, -2.0, 2.9])
MILLIMETRE, HUNDREDTH_DEGREE = 1e-3, np.deg2rad(0.01)


@dataclass
class Trip:
    """A recorded drive with known association: per step the motion and the observations (wall, line, cov, centre)."""

    start: np.ndarray
    motions: np.ndarray
    seen: list[list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]]
    walls: int
    odometry_cov: np.ndarray
    ids: dict[int, int] = field(default_factory=dict)

    @classmethod
    def record(cls, seed=0, steps=60, walls=9, sigmas=(0.01, 0.005), start=START, odometry_cov=ODOMETRY_COV) -> "Trip":
        """Drive a circle inside walls with all directions (also alpha = pi) and both signs of r in the world."""
        rng = np.random.default_rng([4, seed])
        alpha = wrap(np.pi + 2 * np.pi * np.arange(walls) / walls)
        middle = compose(start, np.array([0.0, 1.2, 0.0]))[:2]
        points = middle + 3.0 * normals(alpha) + rng.uniform(-0.7, 0.7, (walls, 1)) * directions(alpha)
        true = compose(start, np.linalg.cholesky(P0) @ rng.standard_normal(3))
        motions, seen = [], []
        for k in range(steps):
            if k:
                motion = np.array([0.15, 0.0, 0.125])
                true = compose(true, motion + np.linalg.cholesky(odometry_cov) @ rng.standard_normal(3))
                motions.append(motion)
            rows = np.sort(rng.choice(walls, 4, replace=False))
            seen.append([(int(i), *look(true, points[i], alpha[i], sigmas, rng)) for i in rows])
        return cls(start, np.array(motions), seen, walls, odometry_cov)

    def run(self, backend, walls_of=lambda k, i: i, ask=True, skip=lambda k, i: False):
        """Feed a back end; wall `i` at step `k` counts as the line of `walls_of(k, i)`."""
        self.ids = {}
        for k, observations in enumerate(self.seen):
            if k:
                backend.predict(Odometry(self.motions[k - 1], self.odometry_cov))
            observations = [(walls_of(k, i), *rest) for i, *rest in observations if not skip(k, i)]
            old = [s for s in observations if s[0] in self.ids]
            new = [s for s in observations if s[0] not in self.ids]
            if old:
                see(backend, [self.ids[s[0]] for s in old], [s[1] for s in old], [s[2] for s in old])
            if new:
                grown = backend.grow(*(np.array([s[j] for s in new]) for j in (1, 2, 3)))
                self.ids.update(zip([s[0] for s in new], grown.tolist(), strict=True))
            if ask:
                belief = backend.belief
                belief.joint(belief.ids[:4])
        return backend

    def dense(self, anchors: np.ndarray, form: str = "shared"):
        """Solve the whole problem with scipy; return poses, lines (alpha, d) by wall, and the covariance of all.

        `shared` takes errors as `slam.estimation.models.innovations` does, `plain` as differences of (alpha, r).
        """
        n, rows = len(self.seen), [(k, *s) for k, observations in enumerate(self.seen) for s in observations]
        step = np.array([r[0] for r in rows])
        wall = np.array([r[1] for r in rows])
        z, cov = np.array([r[2] for r in rows]), np.array([r[3] for r in rows])
        poses = [self.start]
        for motion in self.motions:
            poses.append(compose(poses[-1], motion))
        poses = np.array(poses)
        lines = np.zeros((self.walls, 2))
        for i in range(self.walls):
            first = int(np.flatnonzero(wall == i)[0])
            alpha = wrap(z[first, 0] + poses[step[first], 2])
            lines[i] = alpha, z[first, 1] + normals(alpha) @ (poses[step[first], :2] - anchors[i])
        prior, odometry = (np.linalg.cholesky(np.linalg.inv(P)).T for P in (P0, self.odometry_cov))
        weights = np.linalg.cholesky(np.linalg.inv(cov)).swapaxes(1, 2)
        scale = np.ones((len(rows), 2))
        at_step = [np.flatnonzero(step == k) for k in range(n)]

        def errors(poses, lines):
            return [
                innovations(poses[k], anchors[wall[j]], lines[wall[j]], z[j], cov[j]) for k, j in enumerate(at_step)
            ]

        def residuals(x):
            poses, lines = x[: 3 * n].reshape(-1, 3), x[3 * n :].reshape(-1, 2)
            off = poses[0] - self.start
            off[2] = wrap(off[2])
            moved = np.array([compose(inverse(a), b) for a, b in pairwise(poses)]) - self.motions
            moved[:, 2] = wrap(moved[:, 2])
            if form == "shared":
                e = np.concatenate([at.e for at in errors(poses, lines)]) / scale
            else:
                e = z - np.concatenate(
                    [lines_robot(poses[k], anchors[wall[j]], lines[wall[j]]) for k, j in enumerate(at_step)]
                )
                e[:, 0] = wrap(e[:, 0])
                e = np.einsum("mij,mj->mi", weights, e)
            return np.concatenate([prior @ off, (moved @ odometry.T).ravel(), e.ravel()])

        x = np.concatenate([poses.ravel(), lines.ravel()])
        for _ in range(2):  # The noise of a observation depends a little on the solution.
            R = [at.R for at in errors(x[: 3 * n].reshape(-1, 3), x[3 * n :].reshape(-1, 2))]
            scale = np.sqrt(np.diagonal(np.concatenate(R), axis1=1, axis2=2))
            found = least_squares(residuals, x, method="trf", xtol=1e-13, ftol=1e-13, gtol=1e-13, x_scale="jac")
            x = found.x
        return x[: 3 * n].reshape(-1, 3), x[3 * n :].reshape(-1, 2), np.linalg.inv(found.jac.T @ found.jac)


def look(pose, point, alpha, sigmas, rng):
    """Draw a observation about a point of a wall: its line, covariance and centre in the robot frame."""
    centre = to_robot(point[None], pose)[0]
    seen = float(wrap(alpha - pose[2]))
    turn = np.array([[1.0, 0.0], [directions(np.array(seen)) @ centre, 1.0]])
    line = np.array([seen, normals(np.array(seen)) @ centre]) + turn @ (sigmas * rng.standard_normal(2))
    return line, (turn * np.square(sigmas)) @ turn.T, centre


def see(backend, ids, lines, cov):
    observed = Observations(np.array(ids, dtype=np.int64), np.array(lines), np.array(cov))
    backend.update(observed, observed)


def everything(backend):
    return backend.belief.joint(backend.belief.ids)


def by_wall(trip, backend):
    """Return the joint of pose and lines in the order of the walls."""
    return backend.belief.joint([trip.ids[i] for i in range(trip.walls)])


def assert_same(a, b, place=MILLIMETRE, angle=HUNDREDTH_DEGREE, cov=0.01):
    """Two joints agree, places to `place` m, angles to `angle` rad, covariances to `cov` of the sigmas."""
    off = a.mean - b.mean
    off[2], off[3::2] = wrap(off[2]), wrap(off[3::2])
    np.testing.assert_allclose(off[[0, 1, *range(4, len(off), 2)]], 0.0, atol=place)
    np.testing.assert_allclose(off[[2, *range(3, len(off), 2)]], 0.0, atol=angle)
    sigma = np.sqrt(np.diag(b.cov))
    np.testing.assert_allclose((a.cov - b.cov) / np.outer(sigma, sigma), 0.0, atol=cov)
