"""Pairs of segment and wall that may be one, and what the filter says of each."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...estimation.kernels import innovation_rows, turn_halfway
from ...geometry.compiled import compiled
from .joint_kernels import pair_distances


class Limits(NamedTuple):
    """The numbers of `MatchingConfig` that the loops read, probabilities as levels of chi-square."""

    level: float
    """Of the gate."""
    doubt: float
    """Of what is not ruled out."""
    one_wall: float
    angle_cosine: float
    overlap_m: float
    beside_rad: float
    density: float
    beside_m: float
    """A short segment so near a wall of which it covers half is not a new wall."""
    short_m: float
    """Shorter ones are too poor in direction for the gate alone."""
    far_m: float
    """Lines that are nearer at the seen piece are compared in any case."""


class Seen(NamedTuple):
    """The segments of a scan, as far as matching asks."""

    lines: Float[np.ndarray, "s 2"]
    cov: Float[np.ndarray, "s 2 2"]
    ends: Float[np.ndarray, "s 2 2"]
    is_tentative: Bool[np.ndarray, " s"]


class Known(NamedTuple):
    """The walls near the robot and their joint Gaussian with the pose, as far as matching asks."""

    mean: Float[np.ndarray, " t"]
    cov: Float[np.ndarray, "t t"]
    anchors: Float[np.ndarray, "n 2"]
    extents: Float[np.ndarray, "n 2"]


class Candidates(NamedTuple):
    """Pairs of segment and line that may be one, with what the filter says of each."""

    segment: Int[np.ndarray, " c"]
    line: Int[np.ndarray, " c"]
    e: Float[np.ndarray, "c 2"]
    H_pose: Float[np.ndarray, "c 2 3"]
    H_line: Float[np.ndarray, "c 2 2"]
    R: Float[np.ndarray, "c 2 2"]
    d2: Float[np.ndarray, " c"]
    gap: Float[np.ndarray, " c"]
    """Distance along the line between segment and wall, m; negative where they overlap by that much."""


@compiled
def candidates(seen: Seen, known: Known, limits: Limits) -> Candidates:
    """Return the pairs that are worth a look, by segment and then by line."""
    pose = known.mean[:3]
    means = known.mean[3:].reshape((-1, 2))
    segment, line = _facing(seen.lines, means, pose[2], limits.angle_cosine)
    lines, cov, means = seen.lines[segment], seen.cov[segment], means[line]
    alpha = means[:, 0].copy()
    e, H_pose, H_line, R = innovation_rows(pose, known.anchors[line], means, lines, cov, pose[:2], alpha)
    turn = np.empty(len(line))
    for c in range(len(line)):
        turn[c] = e[c, 0] * _share_of_heading(line[c], known.cov, R[c, 0, 0])
    turn_halfway(e, H_pose, H_line, lines, cov, turn)
    d2 = pair_distances(e, H_pose, H_line, R, line, known.cov)
    gap, near = np.empty(len(line)), np.zeros(len(line), np.bool_)
    for c in range(len(line)):
        low, high = along_line(seen.ends[segment[c]], known.anchors[line[c]], alpha[c], pose)
        gap[c] = gap_to(low, high, known.extents[line[c]])
        near[c] = abs(e[c, 1]) < limits.far_m or d2[c] <= limits.doubt
    return Candidates(segment[near], line[near], e[near], H_pose[near], H_line[near], R[near], d2[near], gap[near])


@compiled
def _facing(
    lines: Float[np.ndarray, "s 2"], means: Float[np.ndarray, "n 2"], heading_rad: float, angle_cosine: float
) -> tuple[Int[np.ndarray, " c"], Int[np.ndarray, " c"]]:
    """Return the pairs of segment and line that face about the same way."""
    segment, line = np.empty(len(lines) * len(means), np.int64), np.empty(len(lines) * len(means), np.int64)
    count = 0
    for s in range(len(lines)):
        for n in range(len(means)):
            if math.cos(lines[s, 0] + heading_rad - means[n, 0]) > angle_cosine:
                segment[count], line[count] = s, n
                count += 1
    return segment[:count].copy(), line[:count].copy()


@compiled
def _share_of_heading(line: int, cov: Float[np.ndarray, "t t"], variance: float) -> float:
    """Return how much of the turn between a segment and its line the robot's heading and the line's own explain."""
    at = 3 + 2 * line
    known = cov[2, 2] - 2.0 * cov[2, at] + cov[at, at]
    return known / (known + variance)


@compiled
def along_line(
    ends_robot: Float[np.ndarray, "2 2"], anchor: Float[np.ndarray, "2"], alpha: float, pose: Float[np.ndarray, "3"]
) -> tuple[float, float]:
    """Return from and to of a segment along its line, m from the line's anchor."""
    # Turned into the line's own axes at once: t = (-sin alpha, cos alpha).
    cosine, sine = math.cos(alpha - pose[2]), math.sin(alpha - pose[2])
    start = math.cos(alpha) * (pose[1] - anchor[1]) - math.sin(alpha) * (pose[0] - anchor[0])
    low = start + cosine * ends_robot[0, 1] - sine * ends_robot[0, 0]
    return low, start + cosine * ends_robot[1, 1] - sine * ends_robot[1, 0]


@compiled
def gap_to(low: float, high: float, extent: Float[np.ndarray, "2"]) -> float:
    """Return the distance along the line from a segment to its wall, m; negative where they overlap by that much."""
    return max(low - extent[1], extent[0] - high)
