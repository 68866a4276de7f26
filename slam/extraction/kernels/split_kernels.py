"""Where a scan falls into straight pieces: the cheapest of all divisions.

Pieces are rows (start, stop) of the returns [start, stop).
"""

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled
from .line_kernels import chi2_of_run
from .returns_kernels import Rules


@compiled
def split(sums: Float[np.ndarray, "m1 6"], breaks: Int[np.ndarray, " b"], rules: Rules) -> Int[np.ndarray, "n 2"]:
    """Return the pieces that make chi-square plus costs least, by dynamic programming over all places to cut.

    The least cost up to a place is that up to the one before, with a loose beam between, or that up to an earlier one
    of the same unbroken run, with a piece from there. A beginning whose piece up to some place costs more than the
    least up to there is none for what lies beyond (PELT): two lines never fit worse than one.
    """
    loose_cost, m = rules.outlier_sigmas**2, len(sums) - 1
    least, came_from = np.zeros(m + 1), np.full(m + 1, -1)
    begins, last, costs = np.empty(m + 1, np.int64), np.empty(m + 1, np.int64), np.empty(m + 1)
    for run in range(len(breaks) - 1):
        count = 0
        for stop in range(breaks[run] + 1, breaks[run + 1] + 1):
            least[stop] = least[stop - 1] + loose_cost
            if stop - rules.least_beams >= breaks[run]:
                begins[count], last[count] = stop - rules.least_beams, m
                count += 1
            for k in range(count):
                costs[k] = least[begins[k]] + chi2_of_run(sums, begins[k], stop)
                if costs[k] + rules.segment_cost < least[stop]:
                    least[stop], came_from[stop] = costs[k] + rules.segment_cost, begins[k]
            kept = 0
            for k in range(count):
                # Up to where a piece from here is as long as pieces must be, the earlier beginning is still one.
                until = min(last[k], stop + rules.least_beams - 1) if costs[k] >= least[stop] else last[k]
                if until > stop:
                    begins[kept], last[kept] = begins[k], until
                    kept += 1
            count = kept
    pieces, count, stop = np.empty((m, 2), np.int64), m, m
    while stop > 0:
        if came_from[stop] >= 0:
            count -= 1
            pieces[count, 0], pieces[count, 1] = came_from[stop], stop
        stop = came_from[stop] if came_from[stop] >= 0 else stop - 1
    return pieces[count:]


@compiled
def surest(pieces: Int[np.ndarray, "n 2"], sums: Float[np.ndarray, "m1 6"]) -> int:
    """Return the cut between two pieces that touch at which two lines save most over one; 0 where there is none."""
    best, position = 0.0, 0
    for k in range(len(pieces) - 1):
        start, at, stop = pieces[k, 0], pieces[k, 1], pieces[k + 1, 1]
        if at == pieces[k + 1, 0]:
            gain = chi2_of_run(sums, start, stop) - chi2_of_run(sums, start, at) - chi2_of_run(sums, at, stop)
            if gain > best:
                best, position = gain, at
    return position
