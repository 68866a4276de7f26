"""Which pairs of segment and wall agree on where the robot is: each pair in turn is believed, and the others judged.

The wheels may have slipped by a degree or two in the last step, which is as much as many walls bend: each segment by
itself then fits its neighbour's wall best. All of them together fit only after one and the same slip (joint
compatibility, Neira and Tardos 2001; with one pair as the seed of each hypothesis nothing branches).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.gates import gate_level
from .joint_compatibility import JointObservations, judged_by_the_rest, squared_distances

_UNMATCHED = -1


@dataclass(frozen=True)
class Hypothesis:
    """What the best of the hypotheses says, and how sure that is."""

    pairs: Int[np.ndarray, " m"]
    """The candidates that agree, at most one for each segment."""
    margin: Float[np.ndarray, " m"]
    """By how much the best hypothesis that gives the segment to another wall costs more (in squared Mahalanobis
    distances); infinite where there is none."""


_NONE = Hypothesis(np.zeros(0, dtype=np.int64), np.zeros(0))


def agree(
    segment: Int[np.ndarray, " c"],
    line: Int[np.ndarray, " c"],
    seen: JointObservations,
    may_seed: Bool[np.ndarray, " c"],
    gate: float,
    doubt: float,
    density: float,
) -> Hypothesis:
    """Return the candidates (pairs of `segment` and `line`, seen together) that the best hypothesis keeps.

    Each candidate within the level of doubt is the seed of a hypothesis: with it, for each segment, goes its best
    candidate within the gate given the seed, less those that contradict the others. A hypothesis costs the squared
    distance of its pairs taken together, and the level of doubt for each segment without one: what lies along a wall
    is hardly ever another. The cheapest wins; a lone pair beyond the gate only if it is likelier so than a wall that
    nobody has seen, of which there are `density` per rad m.
    """
    level, unmatched = gate_level(gate, 2), gate_level(doubt, 2)
    segments, column = np.unique(segment, return_inverse=True)
    own = _own_distances(seen)
    seeds = np.flatnonzero(may_seed & (own <= unmatched))
    if not len(seeds):
        return _NONE
    given = _distances(seen, seeds)
    given[segment[None, :] == segment[seeds][:, None]] = np.inf  # a segment is one observation
    given[np.arange(len(seeds)), seeds] = 0.0
    best = np.full((len(seeds), len(segments)), level)
    choice = np.full((len(seeds), len(segments)), _UNMATCHED)
    for c, k in enumerate(column):
        nearer = given[:, c] <= best[:, k]
        best[nearer, k] = given[nearer, c]
        choice[nearer, k] = c
    choice, costs = _together(seen, np.unique(choice, axis=0), unmatched)
    alone = np.maximum(level, _unlike_new(seen, density))
    matched = choice != _UNMATCHED
    first = choice[np.arange(len(choice)), np.argmax(matched, axis=1)]
    costs[(np.count_nonzero(matched, axis=1) == 1) & (own[first] > alone[first])] = np.inf
    winner = int(np.argmin(costs))
    if not np.isfinite(costs[winner]):
        return _NONE
    walls = np.where(matched, line[choice], _UNMATCHED)
    other = (walls != walls[winner]) & matched
    margins = np.where(other, costs[:, None], np.inf).min(axis=0) - costs[winner]
    return Hypothesis(choice[winner, matched[winner]], margins[matched[winner]])


def _together(
    seen: JointObservations, choice: Int[np.ndarray, "h k"], unmatched: float
) -> tuple[Int[np.ndarray, "h k"], Float[np.ndarray, " h"]]:
    """Return what is left of each hypothesis, and its cost.

    A pair that costs more, given all others of its hypothesis, than a segment without one is dropped, the worst first.
    """
    choice, (hypotheses, count) = choice.copy(), choice.shape
    e, S = seen.e.reshape(-1, 2), seen.S.reshape(len(seen.e) // 2, 2, -1, 2)
    each = np.arange(count)
    while True:
        kept = choice != _UNMATCHED
        both = kept[:, :, None, None, None] & kept[:, None, :, None, None]
        blocks = np.where(both, S[choice[:, :, None], :, choice[:, None, :], :], 0.0)
        blocks[:, each, each] += ~kept[:, :, None, None] * np.eye(2)
        joint = blocks.transpose(0, 1, 3, 2, 4).reshape(hypotheses, 2 * count, 2 * count)
        left = (e[choice] * kept[..., None]).reshape(hypotheses, 2 * count)
        squared, losses = judged_by_the_rest(left, joint)
        worst = np.argmax(losses, axis=1)
        wrong = losses[np.arange(hypotheses), worst] > unmatched
        if not wrong.any():
            return choice, squared + unmatched * np.count_nonzero(~kept, axis=1)
        choice[wrong, worst[wrong]] = _UNMATCHED


def nearest_alone(
    segment: Int[np.ndarray, " c"],
    d2: Float[np.ndarray, " c"],
    seen: JointObservations,
    R: Float[np.ndarray, "c 2 2"],
    gate: float,
    clear: float,
) -> Int[np.ndarray, " k"]:
    """Return for each segment its nearest candidate, unless another wall costs hardly more (by less than `clear`).

    Two landmarks of one wall are not another: by the gate their covariance does not tell them apart. `R` is the noise
    of each candidate's segment, which is the same for all candidates of one.
    """
    order = np.lexsort((d2, segment))
    first = order[np.unique(segment[order], return_index=True)[1]]
    best = first[np.searchsorted(segment[first], segment)]
    each = np.arange(len(segment))
    e, S = seen.e.reshape(-1, 2), seen.S.reshape(len(each), 2, len(each), 2)
    apart = e - e[best]
    cov = S[best, :, best, :] + S[each, :, each, :] - S[best, :, each, :] - S[each, :, best, :] - 2.0 * R
    differ = np.einsum("ci,cij,cj->c", apart, np.linalg.pinv(cov, hermitian=True), apart) > gate_level(gate, 2)
    rivals = (best != each) & differ & (d2 < d2[best] + clear)
    return np.setdiff1d(first, best[rivals])


def _own_distances(seen: JointObservations) -> Float[np.ndarray, " c"]:
    return squared_distances(seen.e.reshape(-1, 2), _own_covariances(seen))


def _own_covariances(seen: JointObservations) -> Float[np.ndarray, "c 2 2"]:
    count = len(seen.e) // 2
    each = np.arange(count)
    return seen.S.reshape(count, 2, count, 2)[each, :, each, :]


def _unlike_new(seen: JointObservations, density: float) -> Float[np.ndarray, " c"]:
    """Return the squared distance up to which a observation is likelier of its wall than of a new one.

    There the Gaussian's own density, exp(-d2 / 2) / (2 pi sqrt(det S)), is that of new walls.
    """
    return np.asarray(-2.0 * np.log(2.0 * np.pi * density) - np.linalg.slogdet(_own_covariances(seen))[1])


def _distances(seen: JointObservations, seeds: Int[np.ndarray, " h"]) -> Float[np.ndarray, "h c"]:
    """Return the squared Mahalanobis distance of each observation, given that the seed is right."""
    count = len(seen.e) // 2
    each = np.arange(count)
    e, S = seen.e.reshape(count, 2), seen.S.reshape(count, 2, count, 2)
    cross = S[:, :, seeds, :].transpose(2, 0, 1, 3)
    gain = cross @ np.linalg.inv(S[seeds, :, seeds, :])[:, None]
    left = S[each, :, each, :] - gain @ cross.swapaxes(2, 3)
    left[np.arange(len(seeds)), seeds] = np.eye(2)  # nothing is left of the seed itself
    return squared_distances(e - (gain @ e[seeds][:, None, :, None])[..., 0], left)
