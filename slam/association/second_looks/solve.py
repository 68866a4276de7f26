"""Poses and lines that agree best with all motions and all sightings: Gauss and Newton's method on a sparse system."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array, csc_array, diags_array
from scipy.sparse.linalg import splu

from ...geometry.lines import directions, normals
from ...geometry.poses import turned, wrap
from .config import SecondLooksConfig
from .landmarks import Sightings

START_SIGMA = 1e-6
"""The first pose is the origin of the map, and is held there (m and rad)."""
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


def without_lines(poses: Float[np.ndarray, "s 3"]) -> Unknowns:
    """Return poses alone."""
    return Unknowns(poses, np.zeros((0, 2)), np.zeros((0, 2)))


def begun(poses: Float[np.ndarray, "s 3"], sightings: Sightings, owner: Int[np.ndarray, " n"]) -> Unknowns:
    """Return lines where the mean of their sightings has them."""
    count = int(owner.max(initial=-1)) + 1
    at = poses[sightings.scan]
    alpha = sightings.alpha + at[:, 2]
    middles = turned(sightings.middles, at[:, 2]) + at[:, :2]
    number = np.maximum(np.bincount(owner, minlength=count), 1)
    mean = [
        np.bincount(owner, values, minlength=count) / number for values in (*middles.T, np.cos(alpha), np.sin(alpha))
    ]
    direction = np.arctan2(mean[3], mean[2])
    return Unknowns(poses, np.column_stack([direction, np.zeros(count)]), np.column_stack(mean[:2]))


@dataclass(frozen=True)
class Links:
    """Where some poses are as seen from others: motions between two scans, or closures."""

    first: Int[np.ndarray, " k"]
    second: Int[np.ndarray, " k"]
    motions: Float[np.ndarray, "k 3"]
    """The second pose in the frame of the first, m m rad."""
    whiteners: Float[np.ndarray, "k 3 3"]
    """What turns the errors of each into independent ones of one standard deviation."""
    doubt: float
    """From so many standard deviations on a link counts less and less (Cauchy's weight)."""


def solved(
    start: Unknowns,
    links: Sequence[Links],
    sightings: Sightings,
    owner: Int[np.ndarray, " n"],
    config: SecondLooksConfig,
) -> Unknowns:
    """Return the unknowns that agree best with links between poses and sightings of lines.

    The first pose stays. What disagrees with all else counts little (Cauchy's weight).
    """
    found = start
    for _ in range(config.iterations):
        information, gradient = normal_equations(found, links, sightings, owner, config)
        change: np.ndarray = splu(information, permc_spec="MMD_AT_PLUS_A").solve(gradient)
        found = found.plus(change)
        if np.abs(change).max() < STILL:
            break
    return found


@dataclass(frozen=True)
class Terms:
    """Whitened errors of groups of k, and their derivatives by the v variables of each group."""

    errors: Float[np.ndarray, "g k"]
    jacobians: Float[np.ndarray, "g k v"]
    columns: Int[np.ndarray, "g v"]


def of_links(poses: Float[np.ndarray, "s 3"], links: Links) -> Terms:
    """Return how far poses are from their links."""
    first, second = poses[links.first], poses[links.second]
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    dx, dy = (second - first)[:, :2].T
    ahead, left = c * dx + s * dy, c * dy - s * dx
    errors = np.column_stack([ahead, left, second[:, 2] - first[:, 2]]) - links.motions
    errors[:, 2] = wrap(errors[:, 2])
    J = np.zeros((len(first), 3, 6))
    J[:, 0, 0], J[:, 0, 1], J[:, 0, 2] = -c, -s, left
    J[:, 1, 0], J[:, 1, 1], J[:, 1, 2] = s, -c, -ahead
    J[:, 0, 3], J[:, 0, 4], J[:, 1, 3], J[:, 1, 4] = c, s, -s, c
    J[:, 2, 2], J[:, 2, 5] = -1.0, 1.0
    columns = np.concatenate([3 * at[:, None] + np.arange(3) for at in (links.first, links.second)], axis=1)
    return Terms(np.matvec(links.whiteners, errors), links.whiteners @ J, columns)


def whiteners(covs: Float[np.ndarray, "k 3 3"]) -> Float[np.ndarray, "k 3 3"]:
    """Return matrices W with W cov W^T = 1."""
    inverses: np.ndarray = np.linalg.inv(np.linalg.cholesky(covs))
    return inverses


def of_sightings(at: Unknowns, sightings: Sightings, owner: Int[np.ndarray, " n"], config: SecondLooksConfig) -> Terms:
    """Return how far lines are from their sightings."""
    pose, line, anchor = at.poses[sightings.scan], at.lines[owner], at.anchors[owner]
    n, t = normals(line[:, 0]), directions(line[:, 0])
    arm = turned(sightings.middles, pose[:, 2])
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
    return Terms(errors / sigmas, J / sigmas[:, :, None], columns)


def normal_equations(
    at: Unknowns,
    links: Sequence[Links],
    sightings: Sightings,
    owner: Int[np.ndarray, " n"],
    config: SecondLooksConfig,
) -> tuple[csc_array, Float[np.ndarray, " u"]]:
    """Return the information about all unknowns, poses first, and where the weighted errors push them."""
    parts = [(of_links(at.poses, each), each.doubt) for each in links]
    parts.append((of_sightings(at, sightings, owner, config), config.doubt))
    size = at.poses.size + at.lines.size
    H, g = csc_array((size, size)), np.zeros(size)
    for part, doubt in parts:
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
    return csc_array(H + diags_array(fixed)), g
