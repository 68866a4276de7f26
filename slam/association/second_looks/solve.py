"""Poses and lines that agree best with all motions and all sightings: Gauss and Newton's method on a sparse system."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from ...geometry.lines import directions, normals
from ...geometry.poses import wrap
from .config import SecondLooksConfig
from .landmarks import Sightings

START_SIGMA = 1e-6
STILL = 1e-5
"""A round that changes no variable by more is the last one."""


@dataclass(frozen=True)
class Unknowns:
    """Poses, and lines as (alpha, d) about their anchors, world frame."""

    poses: Float[np.ndarray, "s 3"]
    lines: Float[np.ndarray, "l 2"]
    anchors: Float[np.ndarray, "l 2"]

    def plus(self, change: Float[np.ndarray, " u"]) -> "Unknowns":
        """Return them after a change, poses first."""
        cut = self.poses.size
        poses = self.poses + change[:cut].reshape(-1, 3)
        lines = self.lines + change[cut:].reshape(-1, 2)
        poses[:, 2], lines[:, 0] = wrap(poses[:, 2]), wrap(lines[:, 0])
        return Unknowns(poses, lines, self.anchors)


def begun(poses: Float[np.ndarray, "s 3"], sightings: Sightings, owner: Int[np.ndarray, " n"]) -> Unknowns:
    """Return lines where the mean of their sightings has them."""
    count = int(owner.max(initial=-1)) + 1
    at = poses[sightings.scan]
    alpha = sightings.alpha + at[:, 2]
    c, s = np.cos(at[:, 2]), np.sin(at[:, 2])
    x, y = sightings.middles.T
    middles = np.column_stack([c * x - s * y, s * x + c * y]) + at[:, :2]
    number = np.maximum(np.bincount(owner, minlength=count), 1)
    mean = [
        np.bincount(owner, values, minlength=count) / number for values in (*middles.T, np.cos(alpha), np.sin(alpha))
    ]
    direction = np.arctan2(mean[3], mean[2])
    return Unknowns(poses, np.column_stack([direction, np.zeros(count)]), np.column_stack(mean[:2]))


def solved(
    start: Unknowns,
    motions: Float[np.ndarray, "t 3"],
    sightings: Sightings,
    owner: Int[np.ndarray, " n"],
    config: SecondLooksConfig,
) -> Unknowns:
    """Return the unknowns that agree best; `motions` lead from each pose to the next, robot frame.

    The first pose stays. Motions and sightings that disagree with all others count little (Cauchy's weight).
    """
    found = start
    for _ in range(config.iterations):
        parts = [_of_motions(found.poses, motions, config), _of_sightings(found, sightings, owner, config)]
        change = _step(parts, found, config.doubt)
        found = found.plus(change)
        if np.abs(change).max() < STILL:
            break
    return found


@dataclass(frozen=True)
class _Terms:
    """Whitened errors of groups of k, and their derivatives by the v variables of each group."""

    errors: Float[np.ndarray, "g k"]
    jacobians: Float[np.ndarray, "g k v"]
    columns: Int[np.ndarray, "g v"]


def _of_motions(
    poses: Float[np.ndarray, "s 3"], motions: Float[np.ndarray, "t 3"], config: SecondLooksConfig
) -> _Terms:
    first, second = poses[:-1], poses[1:]
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    dx, dy = (second - first)[:, :2].T
    ahead, left = c * dx + s * dy, c * dy - s * dx
    errors = np.column_stack([ahead, left, second[:, 2] - first[:, 2]]) - motions
    errors[:, 2] = wrap(errors[:, 2])
    J = np.zeros((len(first), 3, 6))
    J[:, 0, 0], J[:, 0, 1], J[:, 0, 2] = -c, -s, left
    J[:, 1, 0], J[:, 1, 1], J[:, 1, 2] = s, -c, -ahead
    J[:, 0, 3], J[:, 0, 4], J[:, 1, 3], J[:, 1, 4] = c, s, -s, c
    J[:, 2, 2], J[:, 2, 5] = -1.0, 1.0
    sigmas = np.array([config.odometry_m, config.odometry_m, config.odometry_rad])
    columns = 3 * np.arange(len(first))[:, None] + np.arange(6)
    return _Terms(errors / sigmas, J / sigmas[:, None], columns)


def _of_sightings(
    at: Unknowns, sightings: Sightings, owner: Int[np.ndarray, " n"], config: SecondLooksConfig
) -> _Terms:
    pose, line, anchor = at.poses[sightings.scan], at.lines[owner], at.anchors[owner]
    n, t = normals(line[:, 0]), directions(line[:, 0])
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    x, y = sightings.middles.T
    arm = np.column_stack([c * x - s * y, s * x + c * y])
    from_anchor = arm + pose[:, :2] - anchor
    errors = np.column_stack([wrap(sightings.alpha + pose[:, 2] - line[:, 0]), np.vecdot(n, from_anchor) - line[:, 1]])
    J = np.zeros((len(owner), 2, 5))
    J[:, 0, 2], J[:, 0, 3] = 1.0, -1.0
    J[:, 1, :2] = n
    J[:, 1, 2] = n[:, 1] * arm[:, 0] - n[:, 0] * arm[:, 1]
    J[:, 1, 3], J[:, 1, 4] = np.vecdot(t, from_anchor), -1.0
    sigmas = np.column_stack(
        [np.hypot(sightings.sigma_rad, config.floor_rad), np.hypot(sightings.sigma_m, config.floor_m)]
    )
    columns = np.column_stack(
        [*(3 * sightings.scan + k for k in range(3)), *(at.poses.size + 2 * owner + k for k in range(2))]
    )
    return _Terms(errors / sigmas, J / sigmas[:, :, None], columns)


def _step(parts: list[_Terms], at: Unknowns, doubt: float) -> Float[np.ndarray, " u"]:
    """Return the change of all unknowns that the weighted errors ask for."""
    size = at.poses.size + at.lines.size
    H, g = csc_array((size, size)), np.zeros(size)
    for part in parts:
        if not len(part.errors):
            continue
        weights = 1.0 / (1.0 + np.sum(part.errors**2, axis=1) / doubt**2)
        groups, k, v = part.jacobians.shape
        rows = np.repeat(np.arange(groups * k), v)
        columns = np.repeat(part.columns[:, None, :], k, axis=1).ravel()
        J = coo_array((part.jacobians.ravel(), (rows, columns)), shape=(groups * k, size)).tocsr()
        W = diags_array(np.repeat(weights, k))
        H = H + J.T @ W @ J
        g -= J.T @ (W @ part.errors.ravel())
    fixed = np.full(size, 1e-9)
    fixed[:3] = START_SIGMA**-2
    change: np.ndarray = splu(csc_array(H + diags_array(fixed)), permc_spec="MMD_AT_PLUS_A").solve(g)
    return change
