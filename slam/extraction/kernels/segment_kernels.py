"""From a scan to straight segments: break, choose cuts by dynamic programming, sharpen the joints, fit, find ends."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from .fit_kernels import Fitted, fitted
from .joint_kernels import sharpened
from .line_kernels import crossing, line_of, met_at, polar, prefix_sums
from .returns_kernels import Returns, Rules, returns_of, rolled, run_of, turn_of, turned
from .split_kernels import candidates, settled, split, split_gains, surest


class Found(NamedTuple):
    """The segments of a scan as `Segments` holds them."""

    lines: Float[np.ndarray, "n 2"]
    cov: Float[np.ndarray, "n 2 2"]
    ends: Float[np.ndarray, "n 2 2"]
    beams: Int[np.ndarray, "n 2"]
    beam_counts: Int[np.ndarray, " n"]
    at_corner: Bool[np.ndarray, "n 2"]
    chi2: Float[np.ndarray, " n"]
    is_tentative: Bool[np.ndarray, " n"]


@compiled
def segments_of(
    bearings_rad: Float[np.ndarray, " k"],
    ranges_m: Float[np.ndarray, " k"],
    sigmas_m: Float[np.ndarray, " k"],
    sigma_share: float,
    farthest_m: float,
    is_full_turn: bool,
    rules: Rules,
) -> tuple[Found, Bool[np.ndarray, " n"]]:
    """Return the straight segments of a scan, and which are good."""
    returns = returns_of(bearings_rad, ranges_m, sigmas_m, sigma_share, farthest_m, is_full_turn, rules)
    sums = prefix_sums(returns.cos, returns.sin, returns.ranges_m, returns.sigmas_m)
    gains = split_gains(sums, returns.breaks, rules)
    if returns.is_ring and len(returns.beam) >= rules.least_beams:
        # The seam must lie at a corner, else it cuts a wall in two; the surest cut is one.
        returns = rolled(returns, surest(gains))
        sums = prefix_sums(returns.cos, returns.sin, returns.ranges_m, returns.sigmas_m)
        gains = split_gains(sums, returns.breaks, rules)
    pieces = split(sums, candidates(gains, returns.breaks, rules), returns.breaks, rules)
    pieces = settled(pieces, sums, returns.breaks, rules)
    return _described(fitted(sharpened(pieces, sums, returns, rules), returns, rules), returns, rules)


@compiled
def _described(pieces: Fitted, returns: Returns, rules: Rules) -> tuple[Found, Bool[np.ndarray, " n"]]:
    """Return the fitted lines with their ends, where the last beam meets its line or two lines do, and which are good.

    A line is none whose last beams do not meet it, or that its beams leave open.
    """
    n, m = len(pieces.counts), len(returns.beam)
    lines, cov, ends = np.empty((n, 2)), np.empty((n, 2, 2)), np.empty((n, 2, 2))
    beams, at_corner, good = np.empty((n, 2), np.int64), np.zeros((n, 2), np.bool_), np.ones(n, np.bool_)
    for k in range(n):
        line = line_of(pieces.lines, k)
        lines[k, 0], lines[k, 1], cov[k, 0, 0], cov[k, 0, 1], cov[k, 1, 1] = polar(line)
        cov[k, 1, 0] = cov[k, 0, 1]
        for end in range(2):
            at = pieces.place[k, end] % m
            range_m = met_at(line, returns.cos[at], returns.sin[at])
            ends[k, end, 0], ends[k, end, 1] = range_m * returns.cos[at], range_m * returns.sin[at]
            beams[k, end] = returns.beam[at]
            good[k] &= range_m > 0.0
    for k in range(n if returns.is_ring and n > 1 else n - 1):
        after = (k + 1) % n
        is_corner, x, y = _corner(pieces, k, after, returns, rules)
        if is_corner:
            ends[k, 1, 0], ends[k, 1, 1] = x, y
            ends[after, 0, 0], ends[after, 0, 1] = x, y
            at_corner[k, 1] = at_corner[after, 0] = True
    for k in range(n):
        told = cov[k, 0, 0] + cov[k, 0, 1] + cov[k, 1, 1]
        for end in range(2):
            told += ends[k, end, 0] + ends[k, end, 1]
        good[k] &= np.isfinite(told)
    return Found(lines, cov, ends, beams, pieces.counts, at_corner, pieces.chi2, pieces.counts < rules.sure_beams), good


@compiled
def _corner(pieces: Fitted, k: int, after: int, returns: Returns, rules: Rules) -> tuple[bool, float, float]:
    """Return whether a segment meets its successor, and the point m where their lines cross."""
    m, last, first = len(returns.beam), pieces.place[k, 1], pieces.place[after, 0]
    if run_of(last % m, returns) != run_of(first % m, returns):
        return False, 0.0, 0.0
    one, other = line_of(pieces.lines, k), line_of(pieces.lines, after)
    begins = turn_of(first, returns) + (returns.period if after < k else 0)
    half = 0.5 * (begins - turn_of(last, returns))
    cm, sm = turned(returns, last % m, half * returns.step_rad)
    past = crossing(one, other, cm, sm)
    if not (abs(past) <= (half + 1.0) * returns.step_rad and 2.0 * half <= rules.gap_beams + 1):
        return False, 0.0, 0.0
    c, s = cm * np.cos(past) - sm * np.sin(past), sm * np.cos(past) + cm * np.sin(past)
    range_m = 2.0 / ((one.a + other.a) * c + (one.b + other.b) * s)
    return True, range_m * c, range_m * s
