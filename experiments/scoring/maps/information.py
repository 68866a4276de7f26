"""How much a map tells about the true walls, by a proper scoring rule: an overconfident map scores less, not more."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from chainslam.slam.estimation.backend import POSE
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.map.stochastic_map import StochasticMap

from .coverage import NEAR_NOISY_M, Samples

PITCH_M = 0.1
"""Largest distance of the points at which the contour is measured."""
BEYOND_M = 0.1
"""A point this far beyond the end of a wall is still predicted by it."""
AGREES = float(np.cos(np.pi / 4.0))
WRONG_SHARE = 0.01
"""Probability that a wall is somewhere else altogether; bounds what one mistake costs."""


@dataclass(frozen=True)
class MapInformation:
    """What is known about the true walls."""

    nat_m: float
    """Integral along the reachable contour of the information about where each of its points lies, nat times m."""
    coverage: float
    """Share of the reachable contour that has a wall."""


@dataclass(frozen=True)
class Ruler:
    """The true contour as points, each of which stands for a piece of it."""

    samples: Samples
    prior_m: float
    """Before anything is seen, a point may lie anywhere within this distance: the scanner's range."""

    def measure(self, walls: StochasticMap) -> MapInformation:
        """Return what a map tells, in the frame of the truth.

        Each point of the contour is predicted by the nearest wall that stands within 0.3 m of it. The score is the
        logarithm of the density that the map states for the true place of the point along its normal, over that of the
        prior. It is largest in expectation if the stated covariance is the true one. A point without a wall scores 0.
        """
        samples, kept = self.samples, np.flatnonzero(~walls.tentative)
        if not len(kept):
            return MapInformation(0.0, 0.0)
        belief = walls.belief
        alpha, d = belief.means[kept].T
        from_anchor = samples.points_world[:, None] - belief.anchors[kept]
        off = np.vecdot(from_anchor, normals(alpha)) - d
        along = np.vecdot(from_anchor, directions(alpha))
        beside = (along > walls.extents[kept, 0] - BEYOND_M) & (along < walls.extents[kept, 1] + BEYOND_M)
        near: Bool[np.ndarray, "p w"] = beside & (samples.normals_world @ normals(alpha).T > AGREES)
        gap = np.where(near, np.abs(off), np.inf)
        wall = np.argmin(gap, axis=1)
        has = gap[np.arange(len(gap)), wall] < NEAR_NOISY_M
        cov = _covariances(walls, kept)[wall[has]]
        lever, error = along[has, wall[has]], off[has, wall[has]]
        var = lever**2 * cov[:, 0, 0] - 2.0 * lever * cov[:, 0, 1] + cov[:, 1, 1]
        nats = np.log(self.prior_m * ((1.0 - WRONG_SHARE) * _density(error, var) + WRONG_SHARE / self.prior_m))
        length = samples.length_m
        return MapInformation(float(nats @ length[has]), float(length[has].sum() / length.sum()))


def _covariances(walls: StochasticMap, rows: np.ndarray) -> Float[np.ndarray, "w 2 2"]:
    """Return the covariance of each line, (alpha rad, d m)."""
    joint = walls.told.belief.joint(walls.ids[rows])
    lines = joint.cov[POSE:, POSE:].reshape(len(rows), 2, len(rows), 2)
    here = np.arange(len(rows))
    return lines[here, :, here]


def _density(error: np.ndarray, var: np.ndarray) -> np.ndarray:
    """Return the density of a normal distribution."""
    return np.asarray(np.exp(-0.5 * error**2 / var) / np.sqrt(2.0 * np.pi * var))
