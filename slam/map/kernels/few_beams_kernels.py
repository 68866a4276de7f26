"""Which faces of a few beams are seen again: the loops of `LandmarkCandidates`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import squared_distance, wrapped
from .existence_kernels import Odds, look
from .ray_kernels import crossings, reaching

Lines = Float[np.ndarray, "n 6"]
"""Lines about the middles of their seen pieces, world frame: alpha, middle x and y, variance of alpha, variance of the
distance at the middle, which is independent of it, and half the length of the piece."""


class Same(NamedTuple):
    """When two seen lines may be one, the gate as a level of chi-square."""

    level: float
    least_cosine: float
    slack_m: float
    """What the pose may have drifted between the two, sigma."""


@compiled
def looked(
    pose_world: Float[np.ndarray, "3"],
    bearings_rad: Float[np.ndarray, " k"],
    passed_m: Float[np.ndarray, " k"],
    seen: Float[np.ndarray, "s 6"],
    known: Lines,
    log_odds: Float[np.ndarray, " n"],
    places: Float[np.ndarray, "n 2"],
    same: Same,
    odds: Odds,
) -> Int[np.ndarray, " s"]:
    """Take one scan into the log odds of known lines, in place; return which of them each seen line is, -1 for none."""
    line_of = paired(distances(seen, known, same))
    means, extents, is_seen = np.zeros((len(known), 2)), np.empty((len(known), 2)), np.zeros(len(known), np.bool_)
    means[:, 0], extents[:, 0], extents[:, 1] = known[:, 0], -known[:, 5], known[:, 5]
    along, across = crossings(bearings_rad, passed_m, pose_world, known[:, 1:3].copy(), means)
    for line in line_of:
        if line >= 0:
            is_seen[line] = True
    look(pose_world, reaching(along, across, extents, odds.margin_m), is_seen, log_odds, places, odds)
    return line_of


@compiled
def lines_of(
    pose_world: Float[np.ndarray, "3"],
    lines: Float[np.ndarray, "s 2"],
    cov: Float[np.ndarray, "s 2 2"],
    ends: Float[np.ndarray, "s 2 2"],
) -> Float[np.ndarray, "s 6"]:
    """Return seen segments as `Lines`."""
    seen = np.empty((len(lines), 6))
    cosine, sine = math.cos(pose_world[2]), math.sin(pose_world[2])
    for s in range(len(lines)):
        x, y = 0.5 * (ends[s, 0, 0] + ends[s, 1, 0]), 0.5 * (ends[s, 0, 1] + ends[s, 1, 1])
        seen[s, 0] = wrapped(lines[s, 0] + pose_world[2])
        seen[s, 1] = cosine * x - sine * y + pose_world[0]
        seen[s, 2] = sine * x + cosine * y + pose_world[1]
        seen[s, 3] = cov[s, 0, 0]
        seen[s, 4] = cov[s, 1, 1] - cov[s, 0, 1] ** 2 / cov[s, 0, 0]
        seen[s, 5] = 0.5 * math.hypot(ends[s, 1, 0] - ends[s, 0, 0], ends[s, 1, 1] - ends[s, 0, 1])
    return seen


@compiled
def distances(seen: Float[np.ndarray, "s 6"], known: Lines, same: Same) -> Float[np.ndarray, "s n"]:
    """Return the squared Mahalanobis distance of each seen line from each known, infinite where they are none."""
    d2 = np.full((len(seen), len(known)), np.inf)
    for s in range(len(seen)):
        for n in range(len(known)):
            turn = wrapped(seen[s, 0] - known[n, 0])
            if math.cos(turn) < same.least_cosine:
                continue
            x, y = seen[s, 1] - known[n, 1], seen[s, 2] - known[n, 2]
            cosine, sine = math.cos(known[n, 0]), math.sin(known[n, 0])
            along = cosine * y - sine * x
            if abs(along) >= seen[s, 5] + known[n, 5]:
                continue
            s00, s01 = seen[s, 3] + known[n, 3], along * known[n, 3]
            s11 = seen[s, 4] + known[n, 4] + along * s01 + same.slack_m**2
            squared = squared_distance(turn, cosine * x + sine * y, s00, s01, s11)
            if squared <= same.level:
                d2[s, n] = squared
    return d2


@compiled
def paired(d2: Float[np.ndarray, "s n"]) -> Int[np.ndarray, " s"]:
    """Return the column of each row, -1 for none, the least distances first; each column once at most."""
    column = np.full(d2.shape[0], -1)
    left = d2.copy()
    for _ in range(min(d2.shape[0], d2.shape[1])):
        at = np.argmin(left)
        row, best = at // d2.shape[1], at % d2.shape[1]
        if not math.isfinite(left[row, best]):
            break
        column[row] = best
        left[row, :] = np.inf
        left[:, best] = np.inf
    return column
