"""The walls of second looks: the lines that were solved for, as far as their segments reach, with their covariance."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from ...estimation.backend import POSE, Belief, Joint
from ...geometry.lines import directions, normals
from ...geometry.poses import turned
from ...map.stochastic_map import StochasticMap
from .config import SecondLooksConfig
from .landmarks import Sightings
from .solve import Unknowns

AT_ONCE = 64
"""So many columns of a covariance are solved for together: each is as long as all poses and walls."""


def spans(at: Unknowns, sightings: Sightings, owner: Int[np.ndarray, " n"]) -> Float[np.ndarray, "l 2"]:
    """Return how far each line was seen along itself, from its anchor, m; the farthest end on either side is left out.

    One segment alone may run on across a corner.
    """
    along = _along(at, sightings, owner)
    reach = np.empty((len(at.lines), 2))
    order = np.argsort(owner, kind="stable")
    cuts = np.searchsorted(owner[order], np.arange(len(at.lines) + 1))
    for line, (first, last) in enumerate(pairwise(cuts)):
        low, high = np.sort(along[order[first:last]].T)
        reach[line] = low[min(1, len(low) - 1)], high[max(len(high) - 2, 0)]
    return reach


def _along(at: Unknowns, sightings: Sightings, owner: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 2"]:
    """Return where each sighting begins and ends along its line, m from the anchor, the lesser first."""
    pose = at.poses[sightings.scan]
    ends = turned(sightings.ends, pose[:, 2]) + pose[:, None, :2] - at.anchors[owner][:, None]
    return np.sort(np.vecdot(directions(at.lines[owner, 0])[:, None], ends), axis=1)


def merged(
    at: Unknowns, reach: Float[np.ndarray, "l 2"], owner: Int[np.ndarray, " n"], config: SecondLooksConfig
) -> Int[np.ndarray, " n"]:
    """Return the line of each sighting, where lines that lie on each other are one: the one that was seen more often.

    Their directions differ little, and where they overlap both ends of the overlap are near.
    """
    often = np.bincount(owner, minlength=len(at.lines))
    order = np.argsort(-often, kind="stable")
    keep, rank = np.arange(len(at.lines)), np.argsort(order)
    n, t = normals(at.lines[:, 0]), directions(at.lines[:, 0])
    for line in order:
        if keep[line] != line:
            continue
        alike = np.cos(at.lines[:, 0] - at.lines[line, 0]) > np.cos(config.turn_rad)
        for other in np.flatnonzero(alike & (keep == np.arange(len(keep))) & (rank > rank[line])):
            ends = at.anchors[other] + at.lines[other, 1] * n[other] + reach[other][:, None] * t[other]
            along, across = (ends - at.anchors[line]) @ t[line], (ends - at.anchors[line]) @ n[line] - at.lines[line, 1]
            low, high = max(along.min(), reach[line, 0]), min(along.max(), reach[line, 1])
            if high - low < config.overlap_m:
                continue
            share = (np.array([low, high]) - along[0]) / (along[1] - along[0])
            if np.abs(across[0] + share * (across[1] - across[0])).max() < config.gates_m[-1]:
                keep[other] = line
    _, owner = np.unique(keep[owner], return_inverse=True)
    return owner


def surveyed(
    at: Unknowns,
    information: csc_array,
    sightings: Sightings,
    owner: Int[np.ndarray, " n"],
    config: SecondLooksConfig,
) -> tuple[StochasticMap, Joint]:
    """Return the walls, and the Gaussian of the last pose and all of them; world frame.

    The sightings of a wall share that it is not straight. So each line may be off by the floor at either end.
    """
    reach, count = spans(at, sightings, owner), len(at.lines)
    rows = np.concatenate([at.poses.size - POSE + np.arange(POSE), at.poses.size + np.arange(2 * count)])
    cov = inverse_at(information, rows)
    cov = 0.5 * (cov + cov.T)
    half = 0.5 * np.maximum(reach[:, 1] - reach[:, 0], config.least_m)
    lines = POSE + 2 * np.arange(count)
    cov[lines, lines] += (config.floor_m / half) ** 2
    cov[lines + 1, lines + 1] += config.floor_m**2
    joint = Joint(np.concatenate([at.poses[-1], at.lines.ravel()]), cov, at.anchors)
    belief = Belief(at.poses[-1], cov[:POSE, :POSE], np.arange(count), at.anchors, at.lines, joint.take)
    none = np.zeros(count, dtype=bool)
    return StochasticMap(belief, reach, np.bincount(owner, minlength=count), none, none.copy()), joint


def blocks_at(information: csc_array, count: int) -> Float[np.ndarray, "s 3 3"]:
    """Return the blocks of the first poses on the diagonal of the inverse."""
    solver = splu(information, permc_spec="MMD_AT_PLUS_A")
    found = np.empty((count, POSE, POSE))
    for first in range(0, count, AT_ONCE // POSE):
        poses = np.arange(first, min(first + AT_ONCE // POSE, count))
        rows = (POSE * poses[:, None] + np.arange(POSE)).ravel()
        wanted = np.zeros((information.shape[0], len(rows)))
        wanted[rows, np.arange(len(rows))] = 1.0
        solved = solver.solve(wanted)[rows].reshape(len(poses), POSE, len(poses), POSE)
        found[poses] = solved[np.arange(len(poses)), :, np.arange(len(poses))]
    return 0.5 * (found + found.transpose(0, 2, 1))


def inverse_at(information: csc_array, rows: Int[np.ndarray, " r"]) -> Float[np.ndarray, "r r"]:
    """Return the inverse at some rows and columns, `AT_ONCE` columns at a time."""
    solver = splu(information, permc_spec="MMD_AT_PLUS_A")
    found = np.empty((len(rows), len(rows)))
    for at in range(0, len(rows), AT_ONCE):
        part = rows[at : at + AT_ONCE]
        wanted = np.zeros((information.shape[0], len(part)))
        wanted[part, np.arange(len(part))] = 1.0
        found[:, at : at + len(part)] = solver.solve(wanted)[rows]
    return found
