"""Distances, lengths and areas of a map with their standard deviations, through the joint covariance of all walls."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import directions, normals

PARALLEL = 0.05
"""Two walls whose directions differ by less than this (rad) have no corner that is known along them."""
Z_95 = 1.959963984540054
"""Standard deviations on each side of a 95 % interval of a Gaussian."""


@dataclass(frozen=True)
class Measured:
    """A value with its standard deviation; m, or m^2 for an area."""

    value: float
    sigma: float

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval, to first order."""
        return self.value - Z_95 * self.sigma, self.value + Z_95 * self.sigma


@dataclass(frozen=True)
class CornerPoints:
    """Corners of one map, row by row."""

    positions_world: Float[np.ndarray, "n 2"]
    cov: Float[np.ndarray, "n 2 n 2"]
    """Joint covariance of all positions, m^2."""


def corner_jacobian(
    lines: Float[np.ndarray, "2 2"], anchors: Float[np.ndarray, "2 2"], position_world: Float[np.ndarray, "2"]
) -> tuple[Float[np.ndarray, "2 4"], bool]:
    """Return the derivative of the corner of two walls by their (alpha, d, alpha, d), and whether they really cross.

    From n·(x - c) = d: n·dx = dd - t·(x - c) d_alpha. Walls that are nearly parallel only move a corner across them.
    """
    alpha = lines[:, 0]
    off = np.sum(directions(alpha) * (position_world - anchors), axis=-1)
    crosses = bool(abs(np.sin(alpha[1] - alpha[0])) >= PARALLEL)
    n = normals(alpha)
    solve = np.linalg.inv(n) if crosses else 0.5 * n.T
    return np.stack([-solve[:, 0] * off[0], solve[:, 0], -solve[:, 1] * off[1], solve[:, 1]], axis=-1), crosses


def corner_points(
    positions_world: Float[np.ndarray, "n 2"], jacobians: Float[np.ndarray, "n 2 s"], cov: Float[np.ndarray, "s s"]
) -> CornerPoints:
    """Return corners with their joint covariance, from their derivatives by a state (s,) of covariance (s, s)."""
    n = len(positions_world)
    G = jacobians.reshape(2 * n, cov.shape[0])
    return CornerPoints(positions_world, (G @ cov @ G.T).reshape(n, 2, n, 2))


def distance(corners: CornerPoints, first: int, second: int) -> Measured:
    """Return the distance between two corners."""
    values, sigmas = distances(corners, np.array([[first, second]]))
    return Measured(float(values[0]), float(sigmas[0]))


def distances(corners: CornerPoints, pairs: np.ndarray) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Return distances m and their standard deviations for pairs (p, 2) of corners; 0 sigma at distance 0."""
    i, j = pairs[:, 0], pairs[:, 1]
    between = corners.positions_world[j] - corners.positions_world[i]
    length = np.hypot(*between.T)
    along = between / np.maximum(length, 1e-12)[:, None]
    C = corners.cov
    spread = C[i, :, i] + C[j, :, j] - C[i, :, j] - C[j, :, i]
    variance = np.einsum("pi,pij,pj->p", along, spread, along)
    return length, np.sqrt(np.maximum(variance, 0.0))


def perimeter(corners: CornerPoints, ring: Sequence[int]) -> Measured:
    """Return the length of a closed ring of corners."""
    points = corners.positions_world[list(ring)]
    after = np.roll(points, -1, axis=0) - points
    length = np.hypot(*after.T)
    along = after / np.maximum(length, 1e-12)[:, None]
    return _propagated(float(length.sum()), np.roll(along, 1, axis=0) - along, corners, ring)


def area(corners: CornerPoints, ring: Sequence[int], *holes: Sequence[int]) -> Measured:
    """Return the area inside a closed ring of corners less that of its holes, whichever way each of them runs."""
    total, gradients = 0.0, []
    for sign, each in ((1.0, ring), *((-1.0, hole) for hole in holes)):
        points = corners.positions_world[list(each)]
        before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
        signed = 0.5 * float(np.sum(points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]))
        total += sign * abs(signed)
        turned = 0.5 * np.stack([after[:, 1] - before[:, 1], before[:, 0] - after[:, 0]], axis=-1)
        gradients.append(sign * np.sign(signed) * turned)
    return _propagated(total, np.concatenate(gradients), corners, [k for each in (ring, *holes) for k in each])


def _propagated(
    value: float, gradient: Float[np.ndarray, "r 2"], corners: CornerPoints, ring: Sequence[int]
) -> Measured:
    rows = np.array(ring)
    C = corners.cov[rows[:, None], :, rows[None, :], :]
    variance = float(np.einsum("ri,rsij,sj->", gradient, C, gradient))
    return Measured(value, float(np.sqrt(max(variance, 0.0))))
