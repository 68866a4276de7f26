"""From candidates to pairs: those that agree and stand out, or for each segment the nearest that is alone."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import gain_of, whitening
from .candidate_kernels import Candidates, Known, Limits, Seen, along_line, candidates, gap_to
from .hypothesis_kernels import agree
from .joint_kernels import taken_together
from .rest_kernels import UNMATCHED, compatible, nearest_alone


@compiled
def matched(
    seen: Seen, known: Known, limits: Limits, together: Float[np.ndarray, " l"], clear_only: bool
) -> tuple[Int[np.ndarray, "m 2"], Float[np.ndarray, " m"], Bool[np.ndarray, " s"], Candidates]:
    """Return pairs (segment, line) and their distances, which segments are in doubt, and the candidates.

    `together` are the levels of so many clear pairs together.
    """
    found = candidates(seen, known, limits)
    covers = np.empty(len(found.segment), np.bool_)
    for c in range(len(covers)):
        covers[c] = found.gap[c] <= -limits.overlap_m
    if clear_only:
        chosen = _agreed(found, np.flatnonzero(covers), seen, known, limits, together)
        chosen = still_overlapping(chosen, found, seen, known, limits)
    else:
        for c in range(len(covers)):
            covers[c] = covers[c] and found.d2[c] <= limits.level
        chosen = _nearest(found, np.flatnonzero(covers), known, limits)
    doubtful = near_a_wall(found, seen, limits)
    pairs = np.empty((len(chosen), 2), np.int64)
    for k in range(len(chosen)):
        pairs[k, 0], pairs[k, 1] = found.segment[chosen[k]], found.line[chosen[k]]
    return pairs, found.d2[chosen], doubtful, found


@compiled
def _agreed(
    found: Candidates,
    rows: Int[np.ndarray, " r"],
    seen: Seen,
    known: Known,
    limits: Limits,
    together: Float[np.ndarray, " l"],
) -> Int[np.ndarray, " k"]:
    """Return the candidates among `rows` that agree on where the robot is, where no other choice is nearly as good."""
    segment, line, e = found.segment[rows], found.line[rows], found.e[rows].ravel()
    _, S = taken_together(known.cov, line, found.H_pose[rows], found.H_line[rows], found.R[rows])
    sure = np.empty(len(rows), np.bool_)
    for k in range(len(rows)):
        sure[k] = not seen.is_tentative[segment[k]]
    pairs, margins = agree(segment, line, e, S, sure, limits.level, limits.doubt, limits.density)
    clear = pairs[margins >= limits.level]
    return rows[compatible(clear, e, S, limits.level, together)]


@compiled
def still_overlapping(
    chosen: Int[np.ndarray, " m"], found: Candidates, seen: Seen, known: Known, limits: Limits
) -> Int[np.ndarray, " k"]:
    """Drop pairs that no longer overlap at the pose that all of them lead to.

    A slip of the wheels by 2 degrees shifts a piece of wall 3 m away by 0.1 m along its line, past the end of the wall
    between two rooms and onto the next room's.
    """
    if not len(chosen):
        return chosen
    line, e = found.line[chosen], found.e[chosen].ravel()
    PHt, S = taken_together(known.cov, line, found.H_pose[chosen], found.H_line[chosen], found.R[chosen])
    gain = gain_of(PHt[:3], whitening(S))
    pose = known.mean[:3].copy()
    for i in range(3):
        for k in range(len(e)):
            pose[i] += gain[i, k] * e[k]
    overlap = np.empty(len(chosen), np.bool_)
    for k in range(len(chosen)):
        ends = seen.ends[found.segment[chosen[k]]]
        low, high = along_line(ends, known.anchors[line[k]], known.mean[3 + 2 * line[k]], pose)
        overlap[k] = gap_to(low, high, known.extents[line[k]]) <= -limits.overlap_m
    return chosen[overlap]


@compiled
def _nearest(found: Candidates, rows: Int[np.ndarray, " r"], known: Known, limits: Limits) -> Int[np.ndarray, " k"]:
    """Return for each segment its nearest candidate among `rows`, unless another is nearly as near."""
    segment, e, R = found.segment[rows], found.e[rows].ravel(), found.R[rows]
    _, S = taken_together(known.cov, found.line[rows], found.H_pose[rows], found.H_line[rows], R)
    return rows[nearest_alone(segment, found.d2[rows], e, S, R, limits.one_wall, limits.level)]


@compiled
def near_a_wall(found: Candidates, seen: Seen, limits: Limits) -> Bool[np.ndarray, " s"]:
    """Return which segments lie too near a wall to be a new one."""
    doubtful = np.zeros(len(seen.lines), np.bool_)
    for c in range(len(found.segment)):
        beside = _is_beside(c, found, seen, limits)
        if beside or (found.d2[c] <= limits.doubt and found.gap[c] <= 0.0):
            doubtful[found.segment[c]] = True
    return doubtful


@compiled
def _is_beside(c: int, found: Candidates, seen: Seen, limits: Limits) -> bool:
    """Return whether a candidate is a short segment of which half lies along a wall, whatever its direction."""
    s, turn = found.segment[c], found.e[c, 0]
    length = math.hypot(seen.ends[s, 1, 0] - seen.ends[s, 0, 0], seen.ends[s, 1, 1] - seen.ends[s, 0, 1])
    half = 0.5 * length * math.cos(turn)
    return (
        length < limits.short_m
        and abs(turn) < limits.beside_rad + math.sqrt(limits.level * seen.cov[s, 0, 0])
        and abs(found.e[c, 1]) < limits.beside_m
        and found.gap[c] <= -half
    )


@compiled
def refused(found: Candidates, is_matched: Bool[np.ndarray, " s"]) -> Int[np.ndarray, " u"]:
    """Return the nearest candidate of each segment without a wall that has one."""
    nearest = np.full(len(is_matched), UNMATCHED)
    for c in range(len(found.segment)):
        s = found.segment[c]
        if not is_matched[s] and (nearest[s] == UNMATCHED or found.d2[c] <= found.d2[nearest[s]]):
            nearest[s] = c
    return nearest[nearest != UNMATCHED]
