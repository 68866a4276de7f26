"""The unscented Kalman filter: models are tried at points of the Gaussian, and no Jacobian is taken.

Julier, Uhlmann and Durrant-Whyte, the paper's reference 8. Sigma points lie at the mean and sqrt(3) columns of a root
of the covariance to either side of it, the fourth moment of a Gaussian (n + kappa = 3). Spreads are taken about the
central point, since kappa is below zero: a covariance then remains one (their modified form).

A function of the pose and a few lines needs the points of these alone: with them first in a Cholesky root, the other
columns leave them where they are. So one update costs no more than the full EKF's, and is that of the whole state.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import block_diag, solve_triangular

from ..estimation.backend import POSE, Observations
from ..estimation.models import Initialisation, Linear, Motion, innovations, stack
from ..geometry.lines import normals
from ..geometry.poses import to_robot, wrap
from ..robot import Odometry
from .kalman.dense_map import DenseMap, cholesky
from .kalman.ekf import Ekf

REACH = float(np.sqrt(3.0))


@dataclass(frozen=True)
class Spread:
    """What becomes of a Gaussian in a function: y = mean + A dx + what A leaves out."""

    mean: Float[np.ndarray, " k"]
    A: Float[np.ndarray, "k s"]
    rest: Float[np.ndarray, "k k"]
    """Covariance of what A leaves out."""


def unscented(
    function: Callable[[Float[np.ndarray, "q s"]], Float[np.ndarray, "q k"]],
    mean: Float[np.ndarray, " s"],
    cov: Float[np.ndarray, "s s"],
) -> Spread:
    """Return what becomes of a Gaussian that begins with a pose; the function, of q points at once, must not jump.

    The heading's column of the root is the first, so that the points of a turned pose are its points, turned.
    """
    order = np.concatenate([[2, 0, 1], np.arange(POSE, len(mean))])
    sigmas = np.sqrt(np.diag(cov))[order]
    sizes = np.where(sigmas > 0.0, sigmas, 1.0)  # What is known exactly has no points of its own.
    ratios = cov[order[:, None], order] / np.outer(sizes, sizes)
    np.fill_diagonal(ratios, 1.0)
    root = np.tril(cholesky(ratios))
    points = np.zeros_like(root)
    points[:, order] = REACH * (sigmas[:, None] * root).T
    values = function(np.concatenate([mean[None], mean + points, mean - points]))
    centre, (up, down) = values[0], np.split(values[1:] - values[0], 2)
    odd, even = 0.5 * (up - down), 0.5 * (up + down)
    A = np.zeros((len(centre), len(mean)))
    A[:, order] = (solve_triangular(root, odd, trans=1, lower=True) / REACH).T / sizes
    return Spread(centre + even.sum(axis=0) / REACH**2, A, even.T @ even / REACH**2)


class Ukf(Ekf[DenseMap]):
    """The full filter with sigma points in place of Jacobians, in motion, first sight and update."""

    new_map = DenseMap

    def motion(self, odometry: Odometry) -> tuple[Motion, Float[np.ndarray, "3 3"]]:
        """Return the motion of the points of pose and odometry, and what it adds to the pose's covariance."""
        both = np.concatenate([self.map.pose_world, odometry.motion])
        spread = unscented(_ends, both, block_diag(self.map.pose_cov, odometry.cov))
        pose, F, W = spread.mean, spread.A[:, :POSE], spread.A[:, POSE:]
        pose[2] = wrap(pose[2])
        return Motion(pose, F, W), W @ odometry.cov @ W.T + spread.rest

    def first_sight(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> tuple[Initialisation, Float[np.ndarray, "m 2 2"]]:
        """Return new lines, each from the points of the pose and its own noise."""
        (new, noise), pose = super().first_sight(lines, cov, centres), self.map.pose_world
        for k, anchor in enumerate(new.anchors):
            both = np.concatenate([pose, lines[k]])
            spread = unscented(partial(_about, anchor), both, block_diag(self.map.pose_cov, cov[k]))
            new.means[k], new.G_pose[k], new.G_line[k] = spread.mean, spread.A[:, :POSE], spread.A[:, POSE:]
            noise[k] = new.G_line[k] @ cov[k] @ new.G_line[k].T + spread.rest
        new.means[:, 0] = wrap(new.means[:, 0])
        return new, noise

    def linearise(self, rows: Int[np.ndarray, " m"], seen: Observations) -> Linear:
        """Return the innovations of a scan as the points of pose and lines have them."""
        here = stack(rows, self.compare(rows, seen, self.map.pose_world, self.map.means[rows]))
        ordered = np.sort(here.rows)
        prior, place = self.map.joint(ordered), np.searchsorted(ordered, rows)
        spread = unscented(partial(_off, self.map.anchors[rows], seen, place), prior.mean, prior.cov)
        return Linear(ordered, -spread.A, spread.mean, here.R + spread.rest, place)


def _ends(x: Float[np.ndarray, "q 6"]) -> Float[np.ndarray, "q 3"]:
    """Return where motions end that begin at poses."""
    c, s = np.cos(x[:, 2]), np.sin(x[:, 2])
    return np.stack([x[:, 0] + c * x[:, 3] - s * x[:, 4], x[:, 1] + s * x[:, 3] + c * x[:, 4], x[:, 2] + x[:, 5]], -1)


def _about(anchor: Float[np.ndarray, "2"], x: Float[np.ndarray, "q 5"]) -> Float[np.ndarray, "q 2"]:
    """Return lines seen from poses, (alpha, d) about an anchor."""
    alpha = x[:, 3] + x[:, 2]
    return np.stack([alpha, x[:, 4] + np.vecdot(normals(alpha), x[:, :2] - anchor)], axis=-1)


def _off(
    anchors: Float[np.ndarray, "m 2"], seen: Observations, place: Int[np.ndarray, " m"], x: Float[np.ndarray, "q s"]
) -> Float[np.ndarray, "q k"]:
    """Return how far what was seen is off what poses and lines predict; observation i is of the line at place[i]."""
    q, m = len(x), len(place)
    around = np.concatenate([to_robot(anchors, pose) for pose in x[:, :POSE]])
    means = x[:, POSE:].reshape(q, -1, 2)[:, place] - np.stack([x[:, 2], np.zeros(q)], axis=-1)[:, None]
    lines, cov = np.tile(seen.lines, (q, 1)), np.tile(seen.cov, (q, 1, 1))
    return innovations(np.zeros(POSE), around, means.reshape(-1, 2), lines, cov).e.reshape(q, 2 * m)
