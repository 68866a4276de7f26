"""Which pairs of segment and wall agree on where the robot is: each pair in turn is believed, and the others judged.

The wheels may have slipped by a degree or two in the last step, which is as much as many walls bend: each segment by
itself then fits its neighbour's wall best. All of them together fit only after one and the same slip (joint
compatibility, Neira and Tardos 2001; with one pair as the seed of each hypothesis nothing branches).
"""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import squared_distance
from .rest_kernels import UNMATCHED, judged_by_the_rest, own_distance


@compiled
def agree(
    segment: Int[np.ndarray, " c"],
    line: Int[np.ndarray, " c"],
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    may_seed: Bool[np.ndarray, " c"],
    level: float,
    unmatched: float,
    density: float,
) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Return the candidates (pairs of `segment`, ascending, and `line`) that the best hypothesis keeps, and margins.

    They differ from what is predicted by e, together of covariance S, k = 2 c. Each candidate within the level
    `unmatched` is the seed of a hypothesis: with it, for each segment, goes its best candidate within the gate's
    `level` given the seed, less those that contradict the others. A hypothesis costs the squared distance of its pairs
    taken together, and `unmatched` for each segment without one: what lies along a wall is hardly ever another. The
    cheapest wins; a lone pair beyond the gate only if it is likelier so than a wall that nobody has seen, of which
    there are `density` per rad m.

    The margin of a pair is by how much the best hypothesis that gives the segment to another wall costs more; infinite
    where there is none.
    """
    column = _columns(segment)
    choices = _choices(segment, column, e, S, may_seed, level, unmatched)
    count = choices.shape[1]
    costs = np.empty(len(choices))
    for h in range(len(choices)):
        costs[h] = _drop_contradictions(choices[h], e, S, unmatched)
        first, matched = UNMATCHED, 0
        for k in range(count):
            if choices[h, k] != UNMATCHED:
                first = choices[h, k] if matched == 0 else first
                matched += 1
        costs[h] += unmatched * (count - matched)
        if matched == 1:
            alone = max(level, _unlike_new(first, S, density))
            if own_distance(first, e, S) > alone:
                costs[h] = math.inf
    winner = np.argmin(costs) if len(costs) else -1
    if winner < 0 or not math.isfinite(costs[winner]):
        return np.zeros(0, np.int64), np.zeros(0)
    pairs, margins, kept = np.empty(count, np.int64), np.empty(count), 0
    for k in range(count):
        pair = choices[winner, k]
        if pair == UNMATCHED:
            continue
        least = math.inf
        for h in range(len(choices)):
            if choices[h, k] != UNMATCHED and line[choices[h, k]] != line[pair]:
                least = min(least, costs[h])
        pairs[kept], margins[kept] = pair, least - costs[winner]
        kept += 1
    return pairs[:kept].copy(), margins[:kept].copy()


@compiled
def _columns(segment: Int[np.ndarray, " c"]) -> Int[np.ndarray, " c"]:
    """Return for each candidate which of the segments that have one is its own."""
    column = np.zeros(len(segment), np.int64)
    for c in range(1, len(segment)):
        column[c] = column[c - 1] + (segment[c] != segment[c - 1])
    return column


@compiled
def _choices(
    segment: Int[np.ndarray, " c"],
    column: Int[np.ndarray, " c"],
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    may_seed: Bool[np.ndarray, " c"],
    level: float,
    unmatched: float,
) -> Int[np.ndarray, "h s"]:
    """Return the candidate of each segment in each hypothesis, each hypothesis once, in ascending order."""
    count = column[-1] + 1 if len(column) else 0
    choices, found = np.empty((len(segment), count), np.int64), 0
    choice, best = np.empty(count, np.int64), np.empty(count)
    for seed in range(len(segment)):
        if not (may_seed[seed] and own_distance(seed, e, S) <= unmatched):
            continue
        choice[:], best[:] = UNMATCHED, level
        for c in range(len(segment)):
            # A segment is one observation.
            if segment[c] != segment[seed]:
                distance = _distance_given(c, seed, e, S)
                if distance <= best[column[c]]:
                    choice[column[c]], best[column[c]] = c, distance
        choice[column[seed]] = seed
        found = _insert(choices, found, choice)
    return choices[:found].copy()


@compiled
def _insert(choices: Int[np.ndarray, "h s"], found: int, choice: Int[np.ndarray, " s"]) -> int:
    """Insert a choice among so many in ascending order, unless it is there; return how many there are then."""
    at = found
    while at > 0:
        order = 0
        for k in range(len(choice)):
            if choice[k] != choices[at - 1, k]:
                order = -1 if choice[k] < choices[at - 1, k] else 1
                break
        if order == 0:
            return found
        if order > 0:
            break
        at -= 1
    for h in range(found, at, -1):
        choices[h] = choices[h - 1]
    choices[at] = choice
    return found + 1


@compiled
def _drop_contradictions(
    choice: Int[np.ndarray, " s"], e: Float[np.ndarray, " k"], S: Float[np.ndarray, "k k"], unmatched: float
) -> float:
    """Drop, in place, what costs more given all others than a segment without a wall, the worst first.

    Returns the squared distance of what is left, taken together.
    """
    while True:
        columns = np.flatnonzero(choice != UNMATCHED)
        squared, losses = judged_by_the_rest(choice[columns], e, S)
        if not len(columns):
            return 0.0
        worst = np.argmax(losses)
        wrong = losses[worst] > unmatched
        if not wrong:
            return squared
        choice[columns[worst]] = UNMATCHED


@compiled
def _unlike_new(c: int, S: Float[np.ndarray, "k k"], density: float) -> float:
    """Return the squared distance up to which an observation is likelier of its wall than of a new one.

    There the Gaussian's own density, exp(-d2 / 2) / (2 pi sqrt(det S)), is that of new walls.
    """
    i = 2 * c
    det = S[i, i] * S[i + 1, i + 1] - S[i, i + 1] * S[i + 1, i]
    return -2.0 * math.log(2.0 * math.pi * density) - math.log(det)


@compiled
def _distance_given(c: int, seed: int, e: Float[np.ndarray, " k"], S: Float[np.ndarray, "k k"]) -> float:
    """Return the squared Mahalanobis distance of an observation, given that the seed is right."""
    i, j = 2 * c, 2 * seed
    det = S[j, j] * S[j + 1, j + 1] - S[j, j + 1] * S[j + 1, j]
    k00 = (S[i, j] * S[j + 1, j + 1] - S[i, j + 1] * S[j + 1, j]) / det
    k01 = (S[i, j + 1] * S[j, j] - S[i, j] * S[j, j + 1]) / det
    k10 = (S[i + 1, j] * S[j + 1, j + 1] - S[i + 1, j + 1] * S[j + 1, j]) / det
    k11 = (S[i + 1, j + 1] * S[j, j] - S[i + 1, j] * S[j, j + 1]) / det
    s00 = S[i, i] - k00 * S[i, j] - k01 * S[i, j + 1]
    s01 = S[i, i + 1] - k00 * S[i + 1, j] - k01 * S[i + 1, j + 1]
    s11 = S[i + 1, i + 1] - k10 * S[i + 1, j] - k11 * S[i + 1, j + 1]
    return squared_distance(e[i] - k00 * e[j] - k01 * e[j + 1], e[i + 1] - k10 * e[j] - k11 * e[j + 1], s00, s01, s11)
