"""From a scan to straight segments: break, choose cuts by dynamic programming, sharpen the joints, fit.

The paper takes its extraction from elsewhere (section 2.1); here a line is linear in inverse range (`line_fit`).
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from ..robot import Scan
from .config import ExtractionConfig
from .line_fit import Beams, Fit, crossing, fit_runs, polar, prediction, prefix_sums, refit
from .segments import EndKind, Segments
from .splitting import (
    Pieces,
    Returns,
    cut_at,
    position_of,
    returns_of,
    rolled,
    settled,
    split,
    split_gains,
)

DEFAULT = ExtractionConfig()
NO_VERTICES = np.zeros(0)


def extract(
    scan: Scan, config: ExtractionConfig = DEFAULT, vertices_rad: Float[np.ndarray, " b"] = NO_VERTICES
) -> Segments:
    """Return the straight segments of `scan` in the robot frame, counter-clockwise; none where nothing is straight.

    An end is OPEN also where the wall stops in front of something farther. At the bearings `vertices_rad` the wall is
    known to bend.
    """
    with np.errstate(all="ignore"):
        returns = returns_of(scan, config)
        if returns is None:
            return _none()
        sums = prefix_sums(returns.beams, returns.sigma_m)
        gains = split_gains(returns, sums, config)
        if returns.is_ring:  # the seam must lie at a corner, else it cuts a wall in two; the surest cut is one
            returns = rolled(returns, int(gains.max(axis=0).argmax()))
            sums = prefix_sums(returns.beams, returns.sigma_m)
            gains = split_gains(returns, sums, config)
        pieces = split(gains, sums, returns.breaks, config)
        if len(pieces.start) == 0:
            return _none()
        if len(vertices_rad):
            pieces = cut_at(pieces, position_of(vertices_rad, scan, returns), config)
        pieces = settled(pieces, sums, returns.breaks, config)
        fit, pieces, is_corner, in_doubt = _sharpen(pieces, sums, returns, config)
        return _fitted(fit, pieces, is_corner, in_doubt, returns, config)


def _none() -> Segments:
    return Segments(
        np.zeros((0, 2)),
        np.zeros((0, 2, 2)),
        np.zeros((0, 2, 2)),
        np.zeros((0, 2), int),
        np.zeros(0, int),
        np.zeros((0, 2), int),
        np.zeros(0),
        np.zeros(0, bool),
    )


def _take(fit: Fit, at: Int[np.ndarray, " k"] | Bool[np.ndarray, " n"]) -> Fit:
    return Fit(fit.a[at], fit.b[at], fit.cc[at], fit.cs[at], fit.ss[at])


def _sharpen(
    pieces: Pieces, sums: Float[np.ndarray, "6 m1"], returns: Returns, config: ExtractionConfig
) -> tuple[Fit, Pieces, Bool[np.ndarray, "n 2"], Bool[np.ndarray, "n 2"]]:
    """Return lines, pieces whose boundaries lie where neighbours cross, which ends do so, and which are in doubt."""
    start, stop = pieces.start.copy(), pieces.stop.copy()
    n, m = len(start), len(returns.beam)
    # The beams next to a boundary may be the neighbour's: the lines are taken without them where enough remain.
    inset = (stop - start - 2 > config.least_beams).astype(int)
    fit, _ = fit_runs(sums, start + inset, stop - inset)
    run = returns.breaks.searchsorted(start, side="right")
    k = (run[1:] == run[:-1]).nonzero()[0]
    wrapped = np.zeros(len(k), int)
    if returns.is_ring and n > 1:
        k, wrapped = np.append(k, n - 1), np.append(wrapped, 1)
    after = (k + 1) % n
    left, right = returns.turn[stop[k] - 1], returns.turn[start[after]] + wrapped * returns.period
    half = 0.5 * (right - left)
    cm, sm = _turned(returns.beams, stop[k] - 1, half * returns.step_rad)
    past = crossing(fit.a[k] - fit.a[after], fit.b[k] - fit.b[after], cm, sm) / returns.step_rad
    around = np.concatenate((returns.turn, returns.turn + returns.period)) if returns.is_ring else returns.turn
    cut = around.searchsorted(0.5 * (left + right) + past)
    wrapped *= m
    begins, ends = start[after] + wrapped, stop[after] + wrapped
    meets = np.minimum(cut - start[k], ends - cut) >= config.least_beams
    meets &= np.abs(past) <= 1.0 + half
    k, after, cut, wrapped, begins = k[meets], after[meets], cut[meets], wrapped[meets], begins[meets]
    # Beams that were left loose between the two pieces lie off both lines and stay loose.
    outside = (cut < stop[k]) | (cut > begins)
    stop[k], start[after] = np.where(outside, cut, stop[k]), np.where(outside, cut, begins) - wrapped
    is_corner, in_doubt = np.zeros((n, 2), bool), np.zeros((n, 2), bool)
    is_corner[k, 1] = is_corner[after, 0] = True
    at = np.concatenate((stop[k] - 1, start[after])) % m
    other = np.concatenate((after, k))
    predicted, variance = prediction(_take(fit, other), returns.beams.cos[at], returns.beams.sin[at])
    off2 = np.square(predicted - returns.beams.rho[at])
    explained = off2 < config.doubt_sigmas**2 * (returns.sigma_m[at] ** 2 + variance)
    in_doubt[k, 1], in_doubt[after, 0] = explained[: len(k)], explained[len(k) :]
    return fit, Pieces(start, stop), is_corner, in_doubt


def _turned(
    beams: Beams, at: Int[np.ndarray, " n"], angle: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return cosine and sine of the bearings `angle` rad past the returns `at`."""
    c, s, cos, sin = np.cos(angle), np.sin(angle), beams.cos[at], beams.sin[at]
    return cos * c - sin * s, sin * c + cos * s


def _fitted(
    fit: Fit,
    pieces: Pieces,
    is_corner: Bool[np.ndarray, "n 2"],
    in_doubt: Bool[np.ndarray, "n 2"],
    returns: Returns,
    config: ExtractionConfig,
) -> Segments:
    """Return the pieces trimmed at free ends, fitted, rid of outliers and fitted again."""
    size = pieces.stop - pieces.start
    if size.min() < config.least_beams:
        enough = size >= config.least_beams
        fit, pieces = _take(fit, enough), Pieces(pieces.start[enough], pieces.stop[enough])
        is_corner, in_doubt, size = is_corner[enough], in_doubt[enough], size[enough]
    if len(size) == 0:
        return _none()
    trim = (in_doubt | ~is_corner) & (size - 2 >= config.least_beams)[:, None]
    start = pieces.start + trim[:, 0]
    size = pieces.stop - trim[:, 1] - start
    offsets = size.cumsum() - size
    line = np.arange(len(size)).repeat(size)
    place = np.arange(len(line)) + (start - offsets)[line]
    at = place % len(returns.beam)
    beams = Beams(returns.beams.cos[at], returns.beams.sin[at], returns.beams.rho[at])
    sigma2 = _variances(fit, beams, line, returns.sigma_m[at], returns.sigma_share)
    fit = refit(fit, beams, line, offsets, 1.0 / sigma2)
    sigma2 = _variances(fit, beams, line, returns.sigma_m[at], returns.sigma_share)
    gate = np.full(len(line), config.noise_sigmas**2)
    free = np.concatenate((offsets[~is_corner[:, 0]], (offsets + size - 1)[~is_corner[:, 1]]))
    gate[free] = config.open_gate_sigmas**2
    predicted, variance = prediction(_take(fit, line), beams.cos, beams.sin)
    # A residual varies by sigma^2 less what its own beam lent to the line; a beam that alone holds the line stays.
    is_in = np.square(predicted - beams.rho) <= gate * np.maximum(sigma2 - variance, 1e-6 * sigma2)
    fit = refit(fit, beams, line, offsets, is_in / sigma2)
    counts = np.add.reduceat(is_in, offsets, dtype=int)
    off = 1.0 / (fit.a[line] * beams.cos + fit.b[line] * beams.sin) - beams.rho
    chi2 = np.add.reduceat(np.where(is_in, np.square(off), 0.0) / sigma2, offsets)
    first = np.minimum.reduceat(np.where(is_in, place, place[-1] + 1), offsets)
    last = np.maximum.reduceat(np.where(is_in, place, place[0] - 1), offsets)
    good = (counts >= config.least_beams) & np.isfinite(fit.a + fit.b)
    if not good.all():
        fit, first, last, counts, chi2 = _take(fit, good), first[good], last[good], counts[good], chi2[good]
    return _described(fit, np.array((first, last)).T, counts, chi2, returns, config)


def _variances(
    fit: Fit, beams: Beams, line: Int[np.ndarray, " m"], sigma_m: Float[np.ndarray, " m"], share: float
) -> Float[np.ndarray, " m"]:
    """Return the variances m^2 of ranges, where noise grows with the range that of the range at which a line is met.

    The measured range would give more weight to beams that fell short by chance, and bias the line towards the robot.
    """
    sigma2 = sigma_m**2
    if share == 0.0:
        return sigma2
    met_m = 1.0 / (fit.a[line] * beams.cos + fit.b[line] * beams.sin)
    grown = share**2 * (met_m**2 - beams.rho**2)
    return np.asarray(np.where(np.isfinite(grown), np.maximum(sigma2 + grown, 0.25 * sigma2), sigma2))


def _described(
    fit: Fit,
    place: Int[np.ndarray, "n 2"],
    counts: Int[np.ndarray, " n"],
    chi2: Float[np.ndarray, " n"],
    returns: Returns,
    config: ExtractionConfig,
) -> Segments:
    """Return the fitted lines with their ends: where the last beam meets its line, or where two lines meet."""
    if len(counts) == 0:
        return _none()
    m = len(returns.beam)
    at = place % m
    turn = returns.turn[at]
    if returns.is_ring:
        turn += returns.period * (place // m)
    c, s = returns.beams.cos[at], returns.beams.sin[at]
    rho = 1.0 / (fit.a[:, None] * c + fit.b[:, None] * s)
    ends = np.empty((len(counts), 2, 2))
    ends[..., 0], ends[..., 1] = rho * c, rho * s
    kinds = _free_kinds(fit, place, turn, returns, config)
    k, after, points = _corners(fit, place, turn, returns, config)
    ends[k, 1] = ends[after, 0] = points
    kinds[k, 1] = kinds[after, 0] = EndKind.CORNER
    lines, cov = polar(fit)
    segments = Segments(lines, cov, ends, returns.beam[at], counts, kinds, chi2, counts < config.sure_beams)
    good = (rho > 0.0).all(axis=1) & np.isfinite(cov.sum(axis=(1, 2)) + ends.sum(axis=(1, 2)))
    return segments if good.all() else segments.take(good)


def _free_kinds(
    fit: Fit, place: Int[np.ndarray, "n 2"], turn: Int[np.ndarray, "n 2"], returns: Returns, config: ExtractionConfig
) -> Int[np.ndarray, "n 2"]:
    """Return for each end whether one of the next beams met something nearer than the line would be."""
    m = len(returns.beam)
    outward = np.array((-1, 1))[:, None] * np.arange(1, config.gap_beams + 1)
    beyond = place[..., None] + outward
    at = beyond % m
    steps = np.abs(returns.turn[at] + returns.period * (beyond // m) - turn[..., None])
    inverse = fit.a[:, None, None] * returns.beams.cos[at] + fit.b[:, None, None] * returns.beams.sin[at]
    hides = inverse * (returns.beams.rho[at] + config.noise_sigmas * returns.sigma_m[at]) < 1.0
    hides &= steps <= config.gap_beams
    return np.where(hides.any(axis=-1), int(EndKind.OCCLUDED), int(EndKind.OPEN))


def _corners(
    fit: Fit, place: Int[np.ndarray, "n 2"], turn: Int[np.ndarray, "n 2"], returns: Returns, config: ExtractionConfig
) -> tuple[Int[np.ndarray, " k"], Int[np.ndarray, " k"], Float[np.ndarray, "k 2"]]:
    """Return the segments that meet their successor, the successors, and the points m where their lines cross."""
    n, m = len(place), len(returns.beam)
    k = np.arange(n if returns.is_ring and n > 1 else n - 1)
    after = (k + 1) % n
    run = returns.breaks.searchsorted(place % m, side="right")
    half = 0.5 * (turn[after, 0] + returns.period * (after < k) - turn[k, 1])
    cm, sm = _turned(returns.beams, place[k, 1] % m, half * returns.step_rad)
    past = crossing(fit.a[k] - fit.a[after], fit.b[k] - fit.b[after], cm, sm)
    meet = (np.abs(past) <= (half + 1.0) * returns.step_rad) & (2 * half <= config.gap_beams + 1)
    meet &= run[k, 1] == run[after, 0]
    k, after, past, cm, sm = k[meet], after[meet], past[meet], cm[meet], sm[meet]
    turn_cos, turn_sin = np.cos(past), np.sin(past)
    c, s = cm * turn_cos - sm * turn_sin, sm * turn_cos + cm * turn_sin
    rho = 2.0 / ((fit.a[k] + fit.a[after]) * c + (fit.b[k] + fit.b[after]) * s)
    return k, after, np.array((rho * c, rho * s)).T
