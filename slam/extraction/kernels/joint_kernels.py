"""Where neighbouring pieces of a scan meet: their boundary is put where their lines cross."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from .line_kernels import Line, crossing, fit_run, line_of, met_at, put, variance_met
from .returns_kernels import Returns, Rules, count_below, run_of, turn_of, turned


class Joints(NamedTuple):
    """Pieces with sharp boundaries, and their lines."""

    pieces: Int[np.ndarray, "n 2"]
    """Returns [start, stop); in a ring they may pass the ends."""
    lines: Float[np.ndarray, "n 5"]
    """Rows of `Line`, through the returns of each but those next to its boundaries."""
    is_corner: Bool[np.ndarray, "n 2"]
    """Which ends lie where the line crosses a neighbour's."""
    in_doubt: Bool[np.ndarray, "n 2"]
    """Whose last return the neighbour's line explains, too."""


@compiled
def sharpened(
    pieces: Int[np.ndarray, "n 2"], sums: Float[np.ndarray, "m1 6"], returns: Returns, rules: Rules
) -> Joints:
    """Return pieces whose boundaries lie where neighbours cross."""
    n, m = len(pieces), len(returns.beam)
    lines = np.empty((n, 5))
    for k in range(n):
        put(lines, k, _inner_line(sums, pieces[k, 0], pieces[k, 1], rules))
    sharp, is_corner, in_doubt = pieces.copy(), np.zeros((n, 2), np.bool_), np.zeros((n, 2), np.bool_)
    for k in range(n if returns.is_ring and n > 1 else n - 1):
        after = (k + 1) % n
        wrapped = m if after <= k else 0
        if not wrapped and run_of(pieces[k, 0], returns) != run_of(pieces[after, 0], returns):
            continue
        begins, ends = pieces[after, 0] + wrapped, pieces[after, 1] + wrapped
        cut = _cut_between(pieces[k, 1] - 1, begins, line_of(lines, k), line_of(lines, after), returns)
        if min(cut - pieces[k, 0], ends - cut) < rules.least_beams:
            continue
        # Beams that were left loose between the two pieces lie off both lines and stay loose.
        if cut < pieces[k, 1] or cut > begins:
            sharp[k, 1] = cut
            sharp[after, 0] = cut - wrapped
        is_corner[k, 1] = is_corner[after, 0] = True
        in_doubt[k, 1] = _is_explained((sharp[k, 1] - 1) % m, line_of(lines, after), returns, rules)
        in_doubt[after, 0] = _is_explained(sharp[after, 0] % m, line_of(lines, k), returns, rules)
    return Joints(sharp, lines, is_corner, in_doubt)


@compiled
def _inner_line(sums: Float[np.ndarray, "m1 6"], start: int, stop: int, rules: Rules) -> Line:
    """Return a piece's line; beams next to a boundary may be the neighbour's, and are left out where enough remain."""
    inset = 1 if stop - start - 2 > rules.least_beams else 0
    return fit_run(sums, start + inset, stop - inset)[0]


@compiled
def _cut_between(last: int, first: int, one: Line, other: Line, returns: Returns) -> int:
    """Return the position of the first return past the crossing of two lines, or -1 where they do not meet there.

    The one line ends with the return `last`, the other begins with `first`; past the ends of a ring they go on.
    """
    m = len(returns.beam)
    left, right = turn_of(last, returns), turn_of(first, returns)
    half = 0.5 * (right - left)
    cm, sm = turned(returns, last % m, half * returns.step_rad)
    past = crossing(one, other, cm, sm) / returns.step_rad
    if not abs(past) <= 1.0 + half:
        return -1
    bearing = 0.5 * (left + right) + past
    if not returns.is_ring:
        return count_below(returns.turn, bearing)
    around = m if bearing > returns.turn[-1] else 0
    return around + count_below(returns.turn, bearing - (returns.period if around else 0))


@compiled
def _is_explained(at: int, line: Line, returns: Returns, rules: Rules) -> bool:
    """Return whether a line predicts the range of a return."""
    off = met_at(line, returns.cos[at], returns.sin[at]) - returns.ranges_m[at]
    variance = variance_met(line, returns.cos[at], returns.sin[at])
    return off * off < rules.doubt_sigmas**2 * (returns.sigmas_m[at] ** 2 + variance)
