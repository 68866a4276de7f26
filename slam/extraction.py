"""From a scan to straight segments: break, over-split, choose by dynamic programming, sharpen the joints, fit.

The paper takes its extraction from elsewhere (section 2.1); here a line is linear in inverse range (`line_fit`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from .line_fit import Beams, Fit, crossing, fit_runs, polar, prefix_sums, refit
from .robot import Scan
from .segments import EndKind, Segments


@dataclass(frozen=True)
class ExtractionConfig:
    """What counts as one straight piece of a scan."""

    gap_beams: int = 3
    """A wall does not go on across more beam steps than this without a return."""
    grazing_rad: float = np.deg2rad(6.0)
    """A range jump that a wall at this incidence could not make breaks the scan."""
    jump_sigmas: float = 4.0
    """Range noise allowed on top of that jump, and before a neighbour counts as nearer."""
    split_sigmas: float = 2.0
    """Residual from a chord at which a piece is split; splits are only candidates."""
    segment_cost: float = 18.0
    """Chi-square that one more segment must save."""
    loose_cost: float = 7.0
    """Chi-square of a beam that belongs to no segment."""
    joint_beams: float = 4.0
    """A boundary moves at most this many beams to where its two lines cross."""
    corner_beams: float = 1.0
    """The lines of a corner cross at most this many beams outside the gap between them."""
    gate_sigmas: float = 3.5
    """Residual beyond which a beam leaves the fit."""
    open_gate_sigmas: float = 2.5
    """The same for the last beam at an end that is not a corner, where another surface begins."""
    trim_from_beams: int = 5
    """Segments of this many beams or more lose the last beam at an end that is not a corner."""


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
    sigma_m: float
    """Standard deviation of a range."""


class Pieces(NamedTuple):
    """Candidate segments: the returns [start, stop), each of shape (n,); in a ring they may pass the ends."""

    start: Int[np.ndarray, " n"]
    stop: Int[np.ndarray, " n"]


DEFAULT = ExtractionConfig()
_MIN_FIT = 3
_CHUNK_RAD = 1.5
_FAR_M = 1e4


def extract(scan: Scan, config: ExtractionConfig = DEFAULT) -> Segments:
    """Return the straight segments of `scan` in the robot frame, counter-clockwise; none where nothing is straight."""
    with np.errstate(all="ignore"):
        returns = _returns(scan, config)
        if returns is None:
            return _none()
        sums = prefix_sums(returns.beams, returns.sigma_m)
        pieces = _choose(sums, _candidates(returns, config), returns.breaks, config)
        if len(pieces.start) == 0:
            return _none()
        pieces, is_joint = _sharpen(pieces, sums, returns, config)
        if len(pieces.start) == 0:
            return _none()
        return _segments(pieces, is_joint, sums, returns, config)


def _none() -> Segments:
    return Segments(
        np.zeros((0, 2)),
        np.zeros((0, 2, 2)),
        np.zeros((0, 2, 2)),
        np.zeros((0, 2), int),
        np.zeros(0, int),
        np.zeros((0, 2), int),
    )


def _returns(scan: Scan, config: ExtractionConfig) -> Returns | None:
    """Return the returns and their breaks, rolled to begin after a break, or at the farthest in a closed room."""
    sigma = max(float(scan.sigma_m), 1e-6)
    index = np.flatnonzero((scan.ranges_m > 4.0 * sigma) & (scan.ranges_m <= min(scan.range_max_m, _FAR_M)))
    if len(index) < _MIN_FIT:
        return None
    step = float(scan.bearings_rad[1] - scan.bearings_rad[0])
    period = len(scan.ranges_m) if scan.is_full_turn else 0
    rho = scan.ranges_m[index]
    # Entry i tells whether the surface breaks off between return i-1 and return i; entry 0 is the seam.
    before = np.roll(rho, 1)
    gap = index - np.roll(index, 1)
    gap[0] += period
    growth = np.sin(config.grazing_rad + step * np.arange(config.gap_beams + 1)) / np.sin(config.grazing_rad)
    near, far = np.minimum(rho, before), np.maximum(rho, before)
    is_break = far - near * growth[np.clip(gap, 0, config.gap_beams)] > config.jump_sigmas * sigma
    is_break |= gap > config.gap_beams
    is_break[0] |= period == 0
    breaks = np.flatnonzero(is_break)
    first = int(breaks[0]) if len(breaks) else int(np.argmax(rho))
    breaks = np.append(breaks - first, len(index)) if len(breaks) else np.array([0, len(index)])
    turn = np.concatenate([index[first:], index[:first] + period])
    index = np.concatenate([index[first:], index[:first]])
    bearings = scan.bearings_rad[index]
    beams = Beams(np.cos(bearings), np.sin(bearings), scan.ranges_m[index])
    return Returns(beams, index, turn, breaks, not is_break.any(), period, step, sigma)


def _candidates(returns: Returns, config: ExtractionConfig) -> Int[np.ndarray, " c"]:
    """Return sorted positions where a segment may begin or end: iterative end points on all runs at once."""
    c, s, rho = returns.beams
    q, weight = 1.0 / rho, rho * rho / returns.sigma_m
    low, high = returns.breaks[:-1], returns.breaks[1:] - 1
    chunks = 1 + ((returns.turn[high] - returns.turn[low]) * (returns.step_rad / _CHUNK_RAD)).astype(int)
    if chunks.max() > 1:  # a chord has no meaning for more than half a turn
        cuts = [np.linspace(i, k, n + 1).astype(int) for i, k, n in zip(low, high, chunks, strict=True)]
        low, high = np.concatenate([cut[:-1] for cut in cuts]), np.concatenate([cut[1:] for cut in cuts])
    points = [low, high]
    while True:
        long = high - low > 1
        low, high = low[long], high[long]
        if len(low) == 0:
            break
        size = high - low - 1
        offsets = np.cumsum(size) - size
        piece = np.repeat(np.arange(len(size)), size)
        inner = np.arange(len(piece)) + (low + 1 - offsets)[piece]
        det = c[low] * s[high] - s[low] * c[high]
        a, b = (q[low] * s[high] - s[low] * q[high]) / det, (c[low] * q[high] - q[low] * c[high]) / det
        off = np.abs(a[piece] * c[inner] + b[piece] * s[inner] - q[inner]) * weight[inner]
        worst = np.maximum.reduceat(off, offsets)
        split = worst > config.split_sigmas
        at = np.flatnonzero((off == worst[piece]) & split[piece])
        at = at[np.append(True, piece[at[1:]] != piece[at[:-1]])] if len(at) else at
        if len(at) == 0:
            break
        middle = inner[at]
        points.append(middle)
        low, high = np.concatenate([low[split], middle]), np.concatenate([middle, high[split]])
    flags = np.zeros(len(rho) + 1, bool)
    split_at = np.concatenate(points)
    flags[split_at] = flags[split_at + 1] = True
    return np.flatnonzero(flags)


def _choose(
    sums: Float[np.ndarray, "6 m1"],
    cuts: Int[np.ndarray, " c"],
    breaks: Int[np.ndarray, " b"],
    config: ExtractionConfig,
) -> Pieces:
    """Return the segments between candidate cuts that make chi-square plus costs least, by dynamic programming."""
    number = np.arange(len(cuts))
    is_break = np.zeros(cuts[-1] + 1, bool)
    is_break[breaks] = True
    run_start = np.maximum.accumulate(np.where(is_break[cuts], number, 0))[:-1]
    choices = number[1:] - run_start
    stop = np.repeat(number[1:], choices)
    start = np.arange(len(stop)) - np.repeat(np.cumsum(choices) - choices - run_start, choices)
    _, chi2 = fit_runs(sums, cuts[start], cuts[stop])
    costs = np.where(np.isfinite(chi2), chi2 + config.segment_cost, np.inf).tolist()
    loose = (config.loose_cost * np.diff(cuts)).tolist()
    best, came_from, pair = [0.0], [0], 0
    for j, i0 in enumerate(run_start.tolist()):
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


def _sharpen(
    pieces: Pieces, sums: Float[np.ndarray, "6 m1"], returns: Returns, config: ExtractionConfig
) -> tuple[Pieces, Bool[np.ndarray, "n 2"]]:
    """Return the pieces with boundaries moved to where neighbouring lines cross, and which ends are such joints."""
    start, stop = pieces.start.copy(), pieces.stop.copy()
    n, m = len(start), len(returns.beam)
    run = np.searchsorted(returns.breaks, start, side="right")
    touches = np.append(run[1:] == run[:-1], returns.is_ring and n > 1)
    # The beams next to the boundary may be the neighbour's: leave them out where enough remain.
    inset = (stop - start > 5).astype(int)
    fit, _ = fit_runs(sums, start + inset, stop - inset)
    k = np.flatnonzero(touches)
    after = (k + 1) % n
    wrapped = np.where(k == n - 1, m, 0)
    left, right = returns.turn[stop[k] - 1], returns.turn[start[after]] + np.where(k == n - 1, returns.period, 0)
    half = 0.5 * (right - left)
    cm, sm = _turned(returns.beams, stop[k] - 1, half * returns.step_rad)
    past = crossing(fit.a[k] - fit.a[after], fit.b[k] - fit.b[after], cm, sm) / returns.step_rad
    around = np.concatenate([returns.turn, returns.turn + max(returns.period, int(returns.turn[-1]) + 1)])
    cut = np.searchsorted(around, 0.5 * (left + right) + past)
    fits = (np.abs(past) <= config.joint_beams + half) & (cut - start[k] >= _MIN_FIT)
    fits &= stop[after] + wrapped - cut >= _MIN_FIT
    k, after, cut, wrapped = k[fits], after[fits], cut[fits], wrapped[fits]
    stop[k], start[after] = cut, cut - wrapped
    is_joint = np.zeros((n, 2), bool)
    is_joint[k, 1] = is_joint[after, 0] = True
    enough = stop - start >= _MIN_FIT
    return Pieces(start[enough], stop[enough]), is_joint[enough]


def _turned(beams: Beams, at: Int[np.ndarray, " n"], angle: Float[np.ndarray, " n"]) -> tuple[np.ndarray, np.ndarray]:
    """Return cosine and sine of the bearings `angle` rad past the returns `at`."""
    c, s = np.cos(angle), np.sin(angle)
    return beams.cos[at] * c - beams.sin[at] * s, beams.sin[at] * c + beams.cos[at] * s


def _segments(
    pieces: Pieces,
    is_joint: Bool[np.ndarray, "n 2"],
    sums: Float[np.ndarray, "6 m1"],
    returns: Returns,
    config: ExtractionConfig,
) -> Segments:
    """Return the pieces trimmed at free ends, fitted, rid of outliers and fitted again."""
    m, sigma = len(returns.beam), returns.sigma_m
    trim = ~is_joint & (pieces.stop - pieces.start >= config.trim_from_beams)[:, None]
    start, stop = pieces.start + trim[:, 0], pieces.stop - trim[:, 1]
    size = stop - start
    offsets = np.cumsum(size) - size
    line = np.repeat(np.arange(len(size)), size)
    place = np.arange(len(line)) + (start - offsets)[line]
    at = place % m
    beams = Beams(returns.beams.cos[at], returns.beams.sin[at], returns.beams.rho[at])
    keep = np.full(len(line), 1.0 / sigma**2)
    fit, residual, leverage = refit(_first_fit(sums, start, stop, m), beams, line, offsets, keep)
    gate = np.full(len(line), config.gate_sigmas * sigma)
    for end, position in ((0, offsets), (1, offsets + size - 1)):
        gate[position[~is_joint[:, end]]] = config.open_gate_sigmas * sigma
    is_in = residual**2 <= gate**2 * np.maximum(1.0 - leverage, 1e-9)
    fit, _, _ = refit(fit, beams, line, offsets, keep * is_in)
    counts = np.add.reduceat(is_in, offsets, dtype=int)
    first = np.minimum.reduceat(np.where(is_in, place, np.iinfo(int).max), offsets)
    last = np.maximum.reduceat(np.where(is_in, place, np.iinfo(int).min), offsets)
    good = (counts >= _MIN_FIT) & np.isfinite(fit.a) & np.isfinite(fit.b)
    return _describe(Fit(*(x[good] for x in fit)), first[good], last[good], counts[good], returns, config)


def _first_fit(
    sums: Float[np.ndarray, "6 m1"], start: Int[np.ndarray, " n"], stop: Int[np.ndarray, " n"], m: int
) -> Fit:
    """Return the fits of runs that may pass the ends of a ring of m returns."""
    whole = (
        np.concatenate(
            [
                sums,
                sums[:, 1:] + sums[:, -1:],
            ],
            axis=1,
        )
        if stop.max() > m or start.min() < 0
        else sums
    )
    shift = np.where(start < 0, m, 0)
    return fit_runs(whole, start + shift, stop + shift)[0]


def _describe(
    fit: Fit,
    first: Int[np.ndarray, " n"],
    last: Int[np.ndarray, " n"],
    counts: Int[np.ndarray, " n"],
    returns: Returns,
    config: ExtractionConfig,
) -> Segments:
    """Return the fitted lines with their ends: where the last beam meets its line, or where two lines meet."""
    n, m = len(counts), len(returns.beam)
    if n == 0:
        return _none()
    lines, cov = polar(fit)
    place = np.stack([first, last], axis=1)
    at = place % m
    c, s = returns.beams.cos[at], returns.beams.sin[at]
    inverse = fit.a[:, None] * c + fit.b[:, None] * s
    ends = np.stack([c, s], axis=-1) / inverse[..., None]
    kinds = _free_kinds(fit, place, returns, config)
    k, after, points = _corners(fit, place, returns, config)
    ends[k, 1] = ends[after, 0] = points
    kinds[k, 1] = kinds[after, 0] = EndKind.CORNER
    segments = Segments(lines, cov, ends, returns.beam[at], counts, kinds)
    good = (
        np.all(inverse > 0.0, axis=1) & np.all(np.isfinite(cov), axis=(1, 2)) & np.all(np.isfinite(ends), axis=(1, 2))
    )
    return segments if good.all() else segments.take(good)


def _turn(returns: Returns, place: Int[np.ndarray, "*n"]) -> Int[np.ndarray, "*n"]:
    """Return the beam index, counted on past the seam, of the returns at `place`, which may pass the ends."""
    m = len(returns.beam)
    turn: np.ndarray = returns.turn[place % m] + returns.period * (place // m)
    return turn


def _free_kinds(
    fit: Fit, place: Int[np.ndarray, "n 2"], returns: Returns, config: ExtractionConfig
) -> Int[np.ndarray, "n 2"]:
    """Return for each end whether one of the next beams met something nearer than the line would be."""
    outward = np.array([[-1], [1]]) * np.arange(1, config.gap_beams + 1)
    beyond = place[..., None] + outward
    steps = np.abs(_turn(returns, beyond) - _turn(returns, place)[..., None])
    at = beyond % len(returns.beam)
    c, s, rho = (x[at] for x in returns.beams)
    nearer = rho + config.jump_sigmas * returns.sigma_m
    hides = (fit.a[:, None, None] * c + fit.b[:, None, None] * s) * nearer < 1.0
    hides &= steps <= config.gap_beams
    return np.where(hides.any(axis=-1), int(EndKind.OCCLUDED), int(EndKind.OPEN))


def _corners(
    fit: Fit, place: Int[np.ndarray, "n 2"], returns: Returns, config: ExtractionConfig
) -> tuple[Int[np.ndarray, " k"], Int[np.ndarray, " k"], Float[np.ndarray, "k 2"]]:
    """Return the segments that meet their successor, the successors, and the points m where their lines cross."""
    n, m = len(place), len(returns.beam)
    k = np.arange(n if returns.is_ring and n > 1 else n - 1)
    after = (k + 1) % n
    left, right = place[k, 1], place[after, 0] + np.where(k == n - 1, m, 0)
    run = np.searchsorted(returns.breaks, place % m, side="right")
    half = 0.5 * (_turn(returns, right) - _turn(returns, left))
    cm, sm = _turned(returns.beams, left % m, half * returns.step_rad)
    past = crossing(fit.a[k] - fit.a[after], fit.b[k] - fit.b[after], cm, sm)
    meet = (np.abs(past) <= (half + config.corner_beams) * returns.step_rad) & (half <= 0.5 * (config.gap_beams + 1))
    meet &= run[k, 1] == run[after, 0]
    k, after = k[meet], after[meet]
    angle_cos, angle_sin = np.cos(past[meet]), np.sin(past[meet])
    c = cm[meet] * angle_cos - sm[meet] * angle_sin
    s = sm[meet] * angle_cos + cm[meet] * angle_sin
    rho = 2.0 / ((fit.a[k] + fit.a[after]) * c + (fit.b[k] + fit.b[after]) * s)
    return k, after, np.stack([rho * c, rho * s], axis=-1)
