"""Where a scan falls into straight pieces: of all there are those that fit best.

Pieces are rows (start, stop) of the returns [start, stop).
"""

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled
from .line_kernels import chi2_of_run
from .returns_kernels import Rules

SEAM_BEAMS = 8
"""So many beams on either side tell where a scan of a full turn is cut open."""


@compiled
def seam(sums: Float[np.ndarray, "m1 6"], breaks: Int[np.ndarray, " b"]) -> int:
    """Return the position at which two lines, over `SEAM_BEAMS` beams on either side, save most over one."""
    best, position = -np.inf, 0
    for run in range(len(breaks) - 1):
        for at in range(breaks[run] + 1, breaks[run + 1]):
            start, stop = max(at - SEAM_BEAMS, breaks[run]), min(at + SEAM_BEAMS, breaks[run + 1])
            gain = chi2_of_run(sums, start, stop) - chi2_of_run(sums, start, at) - chi2_of_run(sums, at, stop)
            if gain > best:
                best, position = gain, at
    return position


@compiled
def split(sums: Float[np.ndarray, "m1 6"], breaks: Int[np.ndarray, " b"], rules: Rules) -> Int[np.ndarray, "n 2"]:
    """Return the pieces that make chi-square plus costs least, of all there are (Killick and others, 2012, PELT).

    The least cost up to a return is that up to the one before, which is left loose, or that up to an earlier one of the
    same unbroken run, with a piece from there. A beginning that costs no less than a later one at which a piece could
    begin as well is of no use any more.
    """
    loose_cost, m = rules.outlier_sigmas**2, len(sums) - 1
    least, came_from = np.zeros(m + 1), np.full(m + 1, -1)
    begins, expires = np.empty(m + 1, np.int64), np.empty(m + 1, np.int64)
    for run in range(len(breaks) - 1):
        count = 0
        for stop in range(breaks[run] + 1, breaks[run + 1] + 1):
            least[stop] = least[stop - 1] + loose_cost
            if stop - rules.least_beams >= breaks[run]:
                begins[count], expires[count] = stop - rules.least_beams, m + 1
                count += 1
            kept = 0
            for k in range(count):
                if expires[k] > stop:
                    begins[kept], expires[kept] = begins[k], expires[k]
                    cost = least[begins[kept]] + (chi2_of_run(sums, begins[kept], stop) + rules.segment_cost)
                    if cost < least[stop]:
                        least[stop], came_from[stop] = cost, begins[kept]
                    kept += 1
            count = kept
            for k in range(count):
                if expires[k] > m and least[begins[k]] + chi2_of_run(sums, begins[k], stop) >= least[stop]:
                    expires[k] = stop + rules.least_beams
    pieces, count, at = np.empty((m, 2), np.int64), m, m
    while at > 0:
        if came_from[at] >= 0:
            count -= 1
            pieces[count, 0], pieces[count, 1] = came_from[at], at
        at = came_from[at] if came_from[at] >= 0 else at - 1
    return pieces[count:].copy()


@compiled
def cut_at(
    pieces: Int[np.ndarray, "n 2"], sums: Float[np.ndarray, "m1 6"], at: Int[np.ndarray, " b"], rules: Rules
) -> Int[np.ndarray, "k 2"]:
    """Cut the pieces that hold the returns `at`, each where the two lines from there to the next cuts fit best.

    Where that leaves a part of fewer than `least_beams` returns, it is cut at the return, and that part is left loose.
    """
    parts, count = np.empty((len(pieces) + len(at), 2), np.int64), 0
    marks = np.sort(at)
    for k in range(len(pieces)):
        start, stop = pieces[k]
        inner = marks[(marks > start) & (marks < stop)]
        for i in range(len(inner)):
            end = inner[i + 1] if i + 1 < len(inner) else stop
            cut, least = inner[i], np.inf
            is_amid = min(cut - start, end - cut) >= rules.least_beams
            for place in range(start + rules.least_beams, end - rules.least_beams + 1 if is_amid else 0):
                two = chi2_of_run(sums, start, place) + chi2_of_run(sums, place, end)
                if two < least:
                    cut, least = place, two
            if cut - start >= rules.least_beams:
                parts[count, 0], parts[count, 1] = start, cut
                count += 1
            start = max(start, cut)
        if stop - start >= rules.least_beams:
            parts[count, 0], parts[count, 1] = start, stop
            count += 1
    return parts[:count]
