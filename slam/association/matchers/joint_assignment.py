"""One joint assignment of a scan's segments, each to a wall, to a new one or to none, by the weights of hypotheses.

A hypothesis weighs what its pairs' joint Gaussian says of them, with its determinant, and the density of new walls for
each segment without one. What hypotheses of nearly all the weight share acts; what they differ in waits.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from ...estimation.backend import Joint
from ...extraction.segments import Segments
from ..kernels.candidate_kernels import Candidates, Known, Limits, Seen, candidates
from ..kernels.joint_kernels import taken_together
from ..kernels.matching_kernels import near_a_wall, refused, still_overlapping
from ..kernels.rest_kernels import apart
from ..matching import NO_MATCHES, KnownWalls, Matches, MatchingConfig, along, limits_of, why

NEW = -1
"""In the place of a candidate: the segment is of no known wall."""


def assign(
    segments: Segments,
    walls: KnownWalls,
    joint: Joint,
    config: MatchingConfig,
    *,
    clear_only: bool = False,
) -> Matches:
    """Match what belongs to one wall with the probability `gate`; what belongs to none with as much is unmatched.

    All other segments are doubtful. `clear_only` asks for no less, and for an overlap at the pose that the pairs say.
    """
    count, ids = len(segments), walls.ids
    if not len(ids) or not count:
        return replace(NO_MATCHES, unmatched=np.arange(count))
    limits = limits_of(config)
    seen = Seen(segments.lines, segments.cov, segments.ends, segments.is_tentative)
    whole = np.zeros(len(ids), dtype=bool) if walls.whole is None else walls.whole
    known = Known(joint.mean, np.ascontiguousarray(joint.cov), joint.anchors, walls.extents, whole)
    found = candidates(seen, known, limits)
    rows = np.flatnonzero(found.gap <= -limits.overlap_m)
    some = Candidates(*(part[rows] for part in found))
    _, S = taken_together(known.cov, some.line, some.H_pose, some.H_line, some.R)
    choices, weights = hypotheses(some, S, ~segments.is_tentative[some.segment], count, limits)
    chosen, waits = acting(some, S, choices, weights, config.gate, limits.one_wall)
    chosen = rows[chosen]
    if clear_only:
        chosen = still_overlapping(chosen, found, seen, known, limits)
    is_matched = np.zeros(count, dtype=bool)
    is_matched[found.segment[chosen]] = True
    return Matches(
        np.stack([found.segment[chosen], ids[found.line[chosen]]], axis=-1),
        found.d2[chosen],
        np.flatnonzero(~is_matched),
        np.flatnonzero(~is_matched & (waits | near_a_wall(found, seen, limits))),
        {int(found.segment[pair]): why(found, pair, ids, limits) for pair in refused(found, is_matched).tolist()},
        along(found, ~is_matched & ~segments.is_tentative, ids, limits, config.shared.straight_rad),
    )


def hypotheses(
    found: Candidates, S: Float[np.ndarray, "k k"], may_seed: Bool[np.ndarray, " c"], count: int, limits: Limits
) -> tuple[Int[np.ndarray, "h s"], Float[np.ndarray, " h"]]:
    """Return the candidate of each of `count` segments in each hypothesis, NEW for none, and posterior weights.

    Each pair in turn is believed, and each other segment has the best that is left given that; the last has no pair.
    """
    choices = {(NEW,) * count: 0.0}
    e, segment = found.e, found.segment
    blocks = S.reshape(len(e), 2, len(e), 2).transpose(0, 2, 1, 3)
    for seed in np.flatnonzero(may_seed & (found.d2 <= limits.doubt)).tolist():
        gain = blocks[:, seed] @ np.linalg.inv(blocks[seed, seed])
        left = e - gain @ e[seed]
        cov = blocks[np.arange(len(e)), np.arange(len(e))] - gain @ blocks[seed, :]
        others = np.flatnonzero(segment != segment[seed])
        gains = _log_ratios(left[others], cov[others], limits.density)
        choice = np.full(count, NEW)
        choice[segment[seed]] = seed
        for k in np.argsort(gains, kind="stable"):  # the likeliest comes last, and stays
            if gains[k] > 0.0:
                choice[segment[others[k]]] = others[k]
        score = _without_the_unlikely(choice, e, blocks, limits)
        choices[tuple(choice.tolist())] = score
    scores = np.array(list(choices.values()))
    weights = np.exp(scores - scores.max())
    return np.array(list(choices), dtype=np.int64), weights / weights.sum()


def acting(
    found: Candidates,
    S: Float[np.ndarray, "k k"],
    choices: Int[np.ndarray, "h s"],
    weights: Float[np.ndarray, " h"],
    sure: float,
    one_wall: float,
) -> tuple[Int[np.ndarray, " m"], Bool[np.ndarray, " s"]]:
    """Return the pairs that are sure over all hypotheses, and which segments are neither sure of a wall nor of none.

    Two landmarks that may be one wall, at the level `one_wall`, count together.
    """
    chosen, waits = [], np.zeros(choices.shape[1], dtype=bool)
    for s in range(choices.shape[1]):
        pairs, places = np.unique(choices[:, s], return_inverse=True)
        share = np.bincount(places, weights=weights)
        best = int(np.argmax(share))
        if pairs[best] == NEW:
            waits[s] = share[best] < sure
            continue
        c = int(pairs[best])
        same = [p >= 0 and (p == c or apart(c, int(p), found.e.ravel(), S, found.R) <= one_wall) for p in pairs]
        if share[same].sum() >= sure:
            chosen.append(c)
        else:
            waits[s] = True
    return np.array(chosen, dtype=np.int64), waits


def _log_ratios(e: Float[np.ndarray, "c 2"], S: Float[np.ndarray, "c 2 2"], density: float) -> Float[np.ndarray, " c"]:
    """Return the logarithm of how much likelier each pair is than a new wall."""
    d2 = np.einsum("ci,cij,cj->c", e, np.linalg.inv(S), e)
    return -0.5 * (d2 + np.log(np.linalg.det(S))) - np.log(2.0 * np.pi * density)


def _without_the_unlikely(
    choice: Int[np.ndarray, " s"], e: Float[np.ndarray, "c 2"], blocks: Float[np.ndarray, "c c 2 2"], limits: Limits
) -> float:
    """Give up, in place, pairs that are less likely than a new wall given all others, the worst first.

    So are those outside the gate given all others. Returns the logarithm of how much likelier the rest is than that all
    are new.
    """
    while True:
        pairs = choice[choice != NEW]
        if not len(pairs):
            return 0.0
        m = len(pairs)
        S = blocks[np.ix_(pairs, pairs)].transpose(0, 2, 1, 3).reshape(2 * m, 2 * m)
        inverse = np.linalg.inv(S)
        white = (inverse @ e[pairs].ravel()).reshape(m, 2)
        own = np.linalg.inv(inverse.reshape(m, 2, m, 2)[np.arange(m), :, np.arange(m), :])
        d2 = np.einsum("ci,cij,cj->c", white, own, white)
        log_ratio = -0.5 * (d2 + np.log(np.linalg.det(own))) - np.log(2.0 * np.pi * limits.density)
        worst = int(np.argmin(log_ratio))
        outside = (d2 > limits.level) & (m > 1)
        if log_ratio[worst] > 0.0 and not outside.any():
            squared = float(e[pairs].ravel() @ white.ravel())
            return -0.5 * (squared + float(np.linalg.slogdet(S)[1])) - m * float(np.log(2.0 * np.pi * limits.density))
        if outside.any():
            worst = int(np.argmax(d2))
        choice[choice == pairs[worst]] = NEW
