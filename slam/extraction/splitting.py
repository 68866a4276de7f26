"""Where a scan falls into straight pieces: breaks, candidate cuts, and the choice among them."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..robot import Scan
from .config import ExtractionConfig
from .line_fit import Beams, fit_runs

_FAR_M = 1e4
"""Farther returns are not used: in inverse range they are noise."""


class Returns(NamedTuple):
    """The returns of one scan in counter-clockwise order, rolled so that no straight piece crosses the ends."""

    beams: Beams
    """Bearings and ranges."""
    beam: Int[np.ndarray, " m"]
    """Beam index in the scan."""
    turn: Int[np.ndarray, " m"]
    """Beam index counted on past the scan's seam, hence increasing."""
    breaks: Int[np.ndarray, " b"]
    """Positions between returns where the surface breaks off, from 0 to m."""
    is_ring: bool
    """Whether the surface goes on from the last return to the first."""
    period: int
    """Beams of a full turn; 0 when the scan is not one."""
    step_rad: float
    """Angle between neighbouring beams."""
    sigma_m: Float[np.ndarray, " m"]
    """Standard deviation of each range, at the measured range."""
    sigma_share: float
    """What of it grows with the range, as a share of the range."""


class Pieces(NamedTuple):
    """Candidate segments: the returns [start, stop), each of shape (n,); in a ring they may pass the ends."""

    start: Int[np.ndarray, " n"]
    stop: Int[np.ndarray, " n"]


@lru_cache(maxsize=16)
def _steepest(step_rad: float, config: ExtractionConfig) -> Float[np.ndarray, " g"]:
    """Return the largest ratio of two ranges on one wall by beams between them; 0, that is a break, beyond the gap."""
    ratios = np.sin(config.grazing_rad + step_rad * np.arange(config.gap_beams + 2)) / np.sin(config.grazing_rad)
    ratios[-1] = 0.0
    return np.asarray(ratios)


def returns_of(scan: Scan, config: ExtractionConfig) -> Returns | None:
    """Return the returns and their breaks, rolled to begin after a break, or at the farthest in a closed room."""
    sigmas = np.maximum(scan.sigmas_m, 1e-6)
    ranges, bearings = scan.ranges_m, scan.bearings_rad
    beam = ((ranges > config.noise_sigmas * sigmas) & (ranges <= min(scan.range_max_m, _FAR_M))).nonzero()[0]
    m = len(beam)
    if m < config.least_beams:
        return None
    step = float(bearings[-1] - bearings[0]) / (len(bearings) - 1)
    period = len(ranges) if scan.is_full_turn else 0
    rho = ranges[beam]
    # Entry i tells whether the surface breaks off between return i-1 and return i; entry 0 is the seam.
    before, gap = np.empty(m), np.empty(m, int)
    before[0], before[1:] = rho[-1], rho[:-1]
    gap[1:] = beam[1:] - beam[:-1]
    gap[0] = beam[0] + period - beam[-1] if period else config.gap_beams + 1
    near, far = np.minimum(rho, before), np.maximum(rho, before)
    steepest = _steepest(step, config)[np.minimum(gap, config.gap_beams + 1)]
    sigma = sigmas[beam]
    noise = np.maximum(sigma, np.concatenate((sigma[-1:], sigma[:-1])))
    found = (far - near * steepest > config.noise_sigmas * noise).nonzero()[0]
    first = int(found[0]) if len(found) else int(rho.argmax())
    breaks = np.empty(max(len(found), 1) + 1, int)
    breaks[0], breaks[-1] = 0, m
    breaks[:-1] = found - first if len(found) else 0
    turn = beam
    if first:
        beam = np.concatenate((beam[first:], beam[:first]))
        turn = beam.copy()
        turn[m - first :] += period
        rho, sigma = ranges[beam], sigmas[beam]
    theta = bearings[beam]
    beams = Beams(np.cos(theta), np.sin(theta), rho)
    return Returns(beams, beam, turn, breaks, len(found) == 0, period, step, sigma, scan.sigma_share)


def split_gains(
    returns: Returns, sums: Float[np.ndarray, "6 m1"], config: ExtractionConfig
) -> Float[np.ndarray, "s m1"]:
    """Return the chi-square that two lines save over one at each position and scale; 0 at breaks."""
    m, breaks = len(returns.beam), returns.breaks
    sizes = breaks[1:] - breaks[:-1]
    at = np.arange(1, m)
    reach = np.array(config.scales)[:, None]
    start, stop = np.empty((3, len(reach), m - 1), int), np.empty((3, len(reach), m - 1), int)
    np.maximum(at - reach, breaks[:-1].repeat(sizes)[1:], out=start[0])
    np.minimum(at + reach, breaks[1:].repeat(sizes)[:-1], out=stop[1])
    start[1], stop[0] = at, at
    start[2], stop[2] = start[0], stop[1]
    chi2 = fit_runs(sums, start, stop)[1]
    gains = np.zeros((len(reach), m + 1))
    gains[:, 1:-1] = chi2[2] - chi2[0] - chi2[1]
    gains[:, breaks] = 0.0
    return gains


def candidates(
    gains: Float[np.ndarray, "s m1"], breaks: Int[np.ndarray, " b"], config: ExtractionConfig
) -> Int[np.ndarray, " c"]:
    """Return sorted positions where a segment may begin or end: the breaks, and the peaks of the gain at any scale."""
    inner = gains[:, 1:-1]
    peak = (inner > config.candidate_gain) & (inner >= gains[:, :-2]) & (inner >= gains[:, 2:])
    sure = (peak & (inner > config.sure_gain)).any(axis=0)
    is_cut = np.zeros(gains.shape[1], bool)
    is_cut[1:-1] = peak.any(axis=0)
    is_cut[2:] |= sure
    is_cut[:-2] |= sure
    is_cut[breaks] = True
    return is_cut.nonzero()[0]


def bends(stretches: Pieces, sums: Float[np.ndarray, "6 m1"], config: ExtractionConfig) -> Int[np.ndarray, " c"]:
    """Return where two lines save more chi-square than a segment costs, the best place of each stretch.

    A long wall that bends by a degree or two is straight at every scale of the candidates, and hundreds in chi-square
    from straight as a whole.
    """
    start, stop = stretches
    places = np.maximum(stop - start - 2 * config.least_beams + 1, 0)
    k = places.nonzero()[0]
    if not len(k):
        return k
    offsets = places[k].cumsum() - places[k]
    stretch = k.repeat(places[k])
    cut = np.arange(len(stretch)) + (start[k] + config.least_beams - offsets).repeat(places[k])
    gains = fit_runs(sums, start[k], stop[k])[1].repeat(places[k])
    gains = gains - fit_runs(sums, start[stretch], cut)[1] - fit_runs(sums, cut, stop[stretch])[1]
    worth = np.fmax.reduceat(gains, offsets) > config.segment_cost
    return np.asarray(cut[np.lexsort((-gains, stretch))[offsets[worth]]])


def rolled(returns: Returns, first: int) -> Returns:
    """Return the returns of a ring, beginning with the one at position `first`."""
    beams = Beams(*(np.concatenate((x[first:], x[:first])) for x in returns.beams))
    beam = np.concatenate((returns.beam[first:], returns.beam[:first]))
    turn = np.concatenate((returns.turn[first:], returns.turn[:first] + returns.period))
    sigma = np.concatenate((returns.sigma_m[first:], returns.sigma_m[:first]))
    return returns._replace(beams=beams, beam=beam, turn=turn, sigma_m=sigma)


def choose(
    sums: Float[np.ndarray, "6 m1"],
    cuts: Int[np.ndarray, " c"],
    breaks: Int[np.ndarray, " b"],
    config: ExtractionConfig,
) -> Pieces:
    """Return the segments between candidate cuts that make chi-square plus costs least, by dynamic programming."""
    number = np.arange(len(cuts))
    # For every cut but the first: the cut at which its unbroken run begins, and all pairs (i, j) within the run.
    run_start = breaks[:-1].searchsorted(cuts[1:], side="left") - 1
    run_start = cuts.searchsorted(breaks[run_start])
    choices = number[1:] - run_start
    j = number[1:].repeat(choices)
    i = np.arange(len(j)) - (choices.cumsum() - choices - run_start).repeat(choices)
    start, stop = cuts[i], cuts[j]
    costs = fit_runs(sums, start, stop)[1] + config.segment_cost
    costs[stop - start < config.least_beams] = np.inf
    return _least(costs.tolist(), run_start.tolist(), cuts, config.open_gate_sigmas**2)


def split(
    gains: Float[np.ndarray, "s m1"],
    sums: Float[np.ndarray, "6 m1"],
    breaks: Int[np.ndarray, " b"],
    config: ExtractionConfig,
) -> Pieces:
    """Return the best segments between candidate cuts; where a segment, or what became none, bends is one, too."""
    cuts = candidates(gains, breaks, config)
    while True:
        pieces = choose(sums, cuts, breaks, config)
        more = np.setdiff1d(bends(_stretches(pieces, cuts), sums, config), cuts, assume_unique=True)
        if not len(more):
            return pieces
        cuts = np.union1d(cuts, more)


def _stretches(pieces: Pieces, cuts: Int[np.ndarray, " c"]) -> Pieces:
    """Return the pieces, and what lies between neighbouring cuts outside them."""
    start, stop = cuts[:-1], cuts[1:]
    reached = np.append(0, pieces.stop)[pieces.start.searchsorted(start, side="right")]
    loose = stop > reached
    return Pieces(np.append(pieces.start, start[loose]), np.append(pieces.stop, stop[loose]))


def _least(costs: list[float], run_start: list[int], cuts: Int[np.ndarray, " c"], loose_cost: float) -> Pieces:
    """Return the cheapest sequence of segments and loose beams; `costs` lists the pairs of cuts by their second."""
    loose = (loose_cost * (cuts[1:] - cuts[:-1])).tolist()
    best, came_from, pair = [0.0], [0], 0
    for j, i0 in enumerate(run_start):
        least, origin = best[j] + loose[j], -1
        for i in range(i0, j + 1):
            cost = best[i] + costs[pair]
            pair += 1
            if cost < least:
                least, origin = cost, i
        best.append(least)
        came_from.append(origin)
    chosen, j = [], len(cuts) - 1
    while j > 0:
        i = came_from[j]
        if i >= 0:
            chosen.append((i, j))
        j = i if i >= 0 else j - 1
    ends = cuts[np.array(chosen[::-1], dtype=int).reshape(-1, 2)]
    return Pieces(ends[:, 0], ends[:, 1])


def position_of(bearings_rad: Float[np.ndarray, " b"], scan: Scan, returns: Returns) -> Int[np.ndarray, " b"]:
    """Return the number of returns that come before each bearing."""
    beam = np.mod(bearings_rad - scan.bearings_rad[0], 2.0 * np.pi) / returns.step_rad
    if returns.period:
        beam = np.mod(beam - returns.turn[0], returns.period) + returns.turn[0]
    return returns.turn.searchsorted(beam)


def cut_at(pieces: Pieces, at: Int[np.ndarray, " b"], config: ExtractionConfig) -> Pieces:
    """Cut the pieces before the returns `at`; a part of fewer than `least_beams` returns is left loose."""
    ends = np.unique(np.concatenate((pieces.start, pieces.stop, at)))
    start, stop = ends[:-1], ends[1:]
    inside = pieces.start.searchsorted(start, side="right") - 1
    kept = (inside >= 0) & (stop <= pieces.stop[inside]) & (stop - start >= config.least_beams)
    return Pieces(start[kept], stop[kept])


def settled(
    pieces: Pieces, sums: Float[np.ndarray, "6 m1"], breaks: Int[np.ndarray, " b"], config: ExtractionConfig
) -> Pieces:
    """Move each cut between two pieces that touch to where their two lines fit best, all cuts at once.

    Where a wall bends by a degree or two the gain at any scale is flat, and its peak lies many beams off the bend: a
    line over the beams of two walls is wrong by the same amount in scan after scan. In a round a cut takes at most
    half of the beams that its neighbours can spare; most stay where they are at once.
    """
    start, stop = pieces.start.copy(), pieces.stop.copy()
    is_break = np.zeros(sums.shape[1], dtype=bool)
    is_break[breaks] = True
    k = np.flatnonzero((stop[:-1] == start[1:]) & ~is_break[stop[:-1]])
    if not len(k):
        return pieces
    for _ in range(config.settling_rounds):
        spare = (stop - start - config.least_beams) // 2
        before, count = spare[k], spare[k] + spare[k + 1] + 1
        offsets = count.cumsum() - count
        pair = np.arange(len(k)).repeat(count)
        cut = np.arange(len(pair)) + (stop[k] - before - offsets)[pair]
        left, right = fit_runs(sums, start[k][pair], cut)[1], fit_runs(sums, cut, stop[k + 1][pair])[1]
        best = cut[np.lexsort((left + right, pair))[offsets]]
        if np.array_equal(best, stop[k]):
            break
        stop[k] = start[k + 1] = best
    return Pieces(start, stop)
