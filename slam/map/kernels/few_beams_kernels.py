"""Which faces of a few beams are seen again, and which are believed: the loops of `candidates`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import squared_distance, wrapped

Lines = Float[np.ndarray, "n 6"]
"""Lines about the middles of their seen pieces, world frame: alpha, middle x and y, variance of alpha, variance of the
distance at the middle, which is independent of it, and half the length of the piece."""


class Rules(NamedTuple):
    """The numbers of `CandidatesConfig` that the loops read, the gate as a level of chi-square."""

    level: float
    least_cosine: float
    looks: int
    apart_m: float
    spare_beams: int
    longest_m: float
    patience_steps: int
    slack_m: float


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
def distances(seen: Float[np.ndarray, "s 6"], known: Lines, rules: Rules) -> Float[np.ndarray, "s n"]:
    """Return the squared Mahalanobis distance of each seen line from each known, infinite where they are none."""
    d2 = np.full((len(seen), len(known)), np.inf)
    for s in range(len(seen)):
        for n in range(len(known)):
            turn = wrapped(seen[s, 0] - known[n, 0])
            if math.cos(turn) < rules.least_cosine:
                continue
            x, y = seen[s, 1] - known[n, 1], seen[s, 2] - known[n, 2]
            cosine, sine = math.cos(known[n, 0]), math.sin(known[n, 0])
            along = cosine * y - sine * x
            if abs(along) >= seen[s, 5] + known[n, 5]:
                continue
            s00, s01 = seen[s, 3] + known[n, 3], along * known[n, 3]
            s11 = seen[s, 4] + known[n, 4] + along * s01 + rules.slack_m**2
            squared = squared_distance(turn, cosine * x + sine * y, s00, s01, s11)
            if squared <= rules.level:
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


@compiled
def see(
    pose_world: Float[np.ndarray, "3"],
    lines: Float[np.ndarray, "s 2"],
    cov: Float[np.ndarray, "s 2 2"],
    ends: Float[np.ndarray, "s 2 2"],
    beam_counts: Int[np.ndarray, " s"],
    known: Lines,
    places: Float[np.ndarray, "n 2"],
    looks: Int[np.ndarray, " n"],
    spare: Int[np.ndarray, " n"],
    unseen: Int[np.ndarray, " n"],
    rules: Rules,
) -> tuple[Bool[np.ndarray, " s"], Int[np.ndarray, " a"], Bool[np.ndarray, " n"], Lines]:
    """Take one scan into the lines that are known, in place.

    Returns which segments are to be believed now, which begin a line, which known lines are kept, and the segments as
    lines.
    """
    every = lines_of(pose_world, lines, cov, ends)
    short = np.zeros(len(every), np.bool_)
    for s in range(len(every)):
        short[s] = 2.0 * every[s, 5] <= rules.longest_m
    rows = np.flatnonzero(short)
    line_of = paired(distances(every[rows], known, rules))
    for n in range(len(known)):
        unseen[n] += 1
    for k in range(len(rows)):
        n = line_of[k]
        if n < 0:
            continue
        unseen[n] = 0
        moved = math.hypot(pose_world[0] - places[n, 0], pose_world[1] - places[n, 1]) >= rules.apart_m
        if moved:
            looks[n] += 1
            spare[n] += beam_counts[rows[k]] - 2
            places[n, 0], places[n, 1] = pose_world[0], pose_world[1]
    due, kept = np.zeros(len(known), np.bool_), np.zeros(len(known), np.bool_)
    for n in range(len(known)):
        due[n] = looks[n] >= rules.looks and spare[n] >= rules.spare_beams
        kept[n] = not due[n] and unseen[n] <= rules.patience_steps
    believed = np.zeros(len(every), np.bool_)
    for k in range(len(rows)):
        believed[rows[k]] = line_of[k] >= 0 and due[line_of[k]]
    return believed, rows[line_of < 0], kept, every
