"""Joint hypotheses on what the segments of a scan are of, and what hypotheses of nearly all the weight share.

The wheels may have slipped by a degree or two in the last step, which is as much as many walls bend: each segment by
itself then fits its neighbour's wall best. All of them together fit only after one and the same slip (joint
compatibility, Neira and Tardos 2001; with one pair as the seed of each hypothesis nothing branches). Hypotheses are
weighed by their likelihood, with the density of new walls for each segment that is of none (Reid 1979).
"""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import squared_distance
from .candidate_kernels import Limits
from .rest_kernels import apart, judged_by_the_rest, own_distance

NEW = -1
"""In the place of a candidate: the segment is of no known wall."""


@compiled
def hypotheses(
    segment: Int[np.ndarray, " c"],
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    may_seed: Bool[np.ndarray, " c"],
    count: int,
    limits: Limits,
) -> tuple[Int[np.ndarray, "h s"], Float[np.ndarray, " h"]]:
    """Return the candidate of each of `count` segments in each hypothesis, `NEW` for none, and posterior weights.

    Candidates are pairs of `segment`, ascending, with a wall; they differ from what is predicted by e, together of
    covariance S, k = 2 c. Each that is not ruled out is believed in turn, and each other segment has its likeliest
    given that, if it is likelier than a new wall. What is less likely than that given all others is given up. In one
    more hypothesis all segments are new.
    """
    choices = np.full((len(segment) + 1, count), NEW)
    logs, found = np.zeros(len(choices)), 1
    for seed in range(len(segment)):
        if may_seed[seed] and own_distance(seed, e, S) <= limits.doubt:
            choice = choices[found]
            _likeliest_given(choice, seed, segment, e, S, limits.density)
            logs[found] = _without_the_unlikely(choice, e, S, limits)
            found += 0 if _is_among(choice, choices[:found]) else 1
    choices, weights = choices[:found].copy(), np.exp(logs[:found] - logs[:found].max())
    return choices, weights / weights.sum()


@compiled
def acting(
    segment: Int[np.ndarray, " c"],
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    R: Float[np.ndarray, "c 2 2"],
    choices: Int[np.ndarray, "h s"],
    weights: Float[np.ndarray, " h"],
    limits: Limits,
) -> tuple[Int[np.ndarray, " m"], Bool[np.ndarray, " s"]]:
    """Return the candidates that have enough of the weight, by segment, and which segments are sure of nothing.

    Neither of a wall nor of none. Two landmarks that may be one wall count together. `R` is the noise of each
    candidate's segment.
    """
    count = choices.shape[1]
    chosen, found, waits = np.empty(count, np.int64), 0, np.zeros(count, np.bool_)
    for s in range(count):
        share = np.zeros(len(segment) + 1)
        for h in range(len(choices)):
            share[choices[h, s]] += weights[h]
        best, weight = NEW, share[NEW]
        for c in range(len(segment)):
            if share[c] > weight:
                best, weight = c, share[c]
        if best != NEW:
            for c in range(len(segment)):
                if c != best and share[c] > 0.0 and apart(c, best, e, S, R) <= limits.one_wall:
                    weight += share[c]
        waits[s] = weight < limits.sure
        if best != NEW and not waits[s]:
            chosen[found] = best
            found += 1
    return chosen[:found].copy(), waits


@compiled
def _likeliest_given(
    choice: Int[np.ndarray, " s"],
    seed: int,
    segment: Int[np.ndarray, " c"],
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    density: float,
) -> None:
    """Choose, in place, the seed, and for each other segment its likeliest candidate given that the seed is right."""
    choice[:] = NEW
    choice[segment[seed]] = seed
    best = np.zeros(len(choice))
    for c in range(len(segment)):
        s = segment[c]
        if s != segment[seed]:
            likelier = _log_ratio_given(c, seed, e, S, density)
            if likelier > best[s]:
                choice[s], best[s] = c, likelier


@compiled
def _without_the_unlikely(
    choice: Int[np.ndarray, " s"], e: Float[np.ndarray, " k"], S: Float[np.ndarray, "k k"], limits: Limits
) -> float:
    """Give up, in place, pairs that are outside the gate given all others, or less likely than new walls, worst first.

    Returns the logarithm of how much likelier the rest is than that all segments are of new walls.
    """
    while True:
        held = np.flatnonzero(choice != NEW)
        if not len(held):
            return 0.0
        squared, log_det, distances, log_dets = judged_by_the_rest(choice[held], e, S)
        worst = np.argmax(distances)
        if len(held) == 1 or distances[worst] <= limits.level:
            worst = np.argmax(distances + log_dets)
            if log_ratio(distances[worst], log_dets[worst], limits.density) > 0.0:
                return log_ratio(squared, log_det, limits.density) - (len(held) - 1) * math.log(_even(limits.density))
        choice[held[worst]] = NEW


@compiled
def log_ratio(squared: float, log_det: float, density: float) -> float:
    """Return the logarithm of how much likelier a pair of such a distance is than a new wall.

    There are `density` of them per rad m; the pair's density is exp(-squared / 2) / (2 pi sqrt(det)).
    """
    return -0.5 * (squared + log_det) - math.log(_even(density))


@compiled
def _even(density: float) -> float:
    return 2.0 * math.pi * density


@compiled
def _is_among(choice: Int[np.ndarray, " s"], choices: Int[np.ndarray, "h s"]) -> bool:
    is_among = False
    for h in range(len(choices)):
        is_among = is_among or bool((choices[h] == choice).all())
    return is_among


@compiled
def _log_ratio_given(
    c: int, seed: int, e: Float[np.ndarray, " k"], S: Float[np.ndarray, "k k"], density: float
) -> float:
    """Return the logarithm of how much likelier a pair is than a new wall, given that the seed is right."""
    i, j = 2 * c, 2 * seed
    det = S[j, j] * S[j + 1, j + 1] - S[j, j + 1] * S[j + 1, j]
    gain, left = np.empty((2, 2)), np.empty(2)
    for row in range(2):
        gain[row, 0] = (S[i + row, j] * S[j + 1, j + 1] - S[i + row, j + 1] * S[j + 1, j]) / det
        gain[row, 1] = (S[i + row, j + 1] * S[j, j] - S[i + row, j] * S[j, j + 1]) / det
        left[row] = e[i + row] - gain[row, 0] * e[j] - gain[row, 1] * e[j + 1]
    s00 = S[i, i] - gain[0, 0] * S[i, j] - gain[0, 1] * S[i, j + 1]
    s01 = S[i, i + 1] - gain[0, 0] * S[i + 1, j] - gain[0, 1] * S[i + 1, j + 1]
    s11 = S[i + 1, i + 1] - gain[1, 0] * S[i + 1, j] - gain[1, 1] * S[i + 1, j + 1]
    squared = squared_distance(left[0], left[1], s00, s01, s11)
    return log_ratio(squared, math.log(s00 * s11 - s01 * s01), density)
