"""Where a scan falls into straight pieces: candidate cuts, the choice among them, and where the chosen ones settle.

Pieces are rows (start, stop) of the returns [start, stop).
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from .line_kernels import chi2_of_run
from .returns_kernels import Rules


@compiled
def split_gains(
    sums: Float[np.ndarray, "m1 6"], breaks: Int[np.ndarray, " b"], rules: Rules
) -> Float[np.ndarray, "s m1"]:
    """Return the chi-square that two lines save over one at each position and scale; 0 at breaks."""
    gains = np.zeros((len(rules.scales), len(sums)))
    for run in range(len(breaks) - 1):
        for at in range(breaks[run] + 1, breaks[run + 1]):
            for k in range(len(rules.scales)):
                start, stop = max(at - rules.scales[k], breaks[run]), min(at + rules.scales[k], breaks[run + 1])
                two = chi2_of_run(sums, start, at) + chi2_of_run(sums, at, stop)
                gains[k, at] = chi2_of_run(sums, start, stop) - two
    return gains


@compiled
def surest(gains: Float[np.ndarray, "s m1"]) -> int:
    """Return the position at which a cut gains most at any scale."""
    best, position = -np.inf, 0
    for at in range(gains.shape[1]):
        for k in range(gains.shape[0]):
            if gains[k, at] > best:
                best, position = gains[k, at], at
    return position


@compiled
def candidates(
    gains: Float[np.ndarray, "s m1"], breaks: Int[np.ndarray, " b"], rules: Rules
) -> Bool[np.ndarray, " m1"]:
    """Return where a segment may begin or end: at breaks, and at the peaks of the gain at any scale."""
    is_cut = np.zeros(gains.shape[1], np.bool_)
    is_cut[breaks] = True
    for k in range(gains.shape[0]):
        for at in range(1, gains.shape[1] - 1):
            gain = gains[k, at]
            if gain > rules.candidate_gain and gain >= gains[k, at - 1] and gain >= gains[k, at + 1]:
                is_cut[at] = True
                if gain > rules.sure_gain:
                    is_cut[at - 1] = is_cut[at + 1] = True
    return is_cut


@compiled
def split(
    sums: Float[np.ndarray, "m1 6"], is_cut: Bool[np.ndarray, " m1"], breaks: Int[np.ndarray, " b"], rules: Rules
) -> Int[np.ndarray, "n 2"]:
    """Return the best pieces between candidate cuts; where a piece, or what became none, bends is a candidate, too."""
    while True:
        cuts = np.flatnonzero(is_cut)
        pieces = choose(sums, cuts, breaks, rules)
        if not _add_bends(sums, is_cut, cuts, pieces, rules):
            return pieces


@compiled
def choose(
    sums: Float[np.ndarray, "m1 6"], cuts: Int[np.ndarray, " c"], breaks: Int[np.ndarray, " b"], rules: Rules
) -> Int[np.ndarray, "n 2"]:
    """Return the pieces between candidate cuts that make chi-square plus costs least, by dynamic programming.

    The least cost up to a cut is that up to the one before, with loose beams between, or that up to an earlier one of
    the same unbroken run, with a piece from there.
    """
    loose_cost = rules.outlier_sigmas**2
    least, came_from = np.zeros(len(cuts)), np.full(len(cuts), -1)
    run, first = 0, 0
    for j in range(1, len(cuts)):
        while breaks[run + 1] < cuts[j]:
            run += 1
        while cuts[first] < breaks[run]:
            first += 1
        least[j] = least[j - 1] + loose_cost * (cuts[j] - cuts[j - 1])
        for i in range(first, j):
            if cuts[j] - cuts[i] < rules.least_beams:
                break
            cost = least[i] + (chi2_of_run(sums, cuts[i], cuts[j]) + rules.segment_cost)
            if cost < least[j]:
                least[j], came_from[j] = cost, i
    pieces, count, j = np.empty((len(cuts), 2), np.int64), len(cuts), len(cuts) - 1
    while j > 0:
        if came_from[j] >= 0:
            count -= 1
            pieces[count, 0], pieces[count, 1] = cuts[came_from[j]], cuts[j]
        j = came_from[j] if came_from[j] >= 0 else j - 1
    return pieces[count:]


@compiled
def _add_bends(
    sums: Float[np.ndarray, "m1 6"],
    is_cut: Bool[np.ndarray, " m1"],
    cuts: Int[np.ndarray, " c"],
    pieces: Int[np.ndarray, "n 2"],
    rules: Rules,
) -> bool:
    """Make candidates of bends, within pieces and between cuts outside them, and return whether there were any.

    A long wall that bends by a degree or two is straight at every scale of the candidates, and hundreds in chi-square
    from straight as a whole.
    """
    is_new, piece = False, 0
    for k in range(len(cuts) - 1):
        while piece < len(pieces) and pieces[piece, 1] <= cuts[k]:
            piece += 1
        start, stop = cuts[k], cuts[k + 1]
        if piece < len(pieces) and pieces[piece, 0] <= start:
            if pieces[piece, 0] < start:
                continue
            stop = pieces[piece, 1]
        at = bend_within(sums, start, stop, rules)
        if at >= 0 and not is_cut[at]:
            is_cut[at] = is_new = True
    return is_new


@compiled
def bend_within(sums: Float[np.ndarray, "m1 6"], start: int, stop: int, rules: Rules) -> int:
    """Return where two lines save the most chi-square, -1 where they nowhere save what a segment costs."""
    best, position = rules.segment_cost, -1
    one = chi2_of_run(sums, start, stop)
    for at in range(start + rules.least_beams, stop - rules.least_beams + 1):
        gain = one - chi2_of_run(sums, start, at) - chi2_of_run(sums, at, stop)
        if gain > best:
            best, position = gain, at
    return position


@compiled
def settled(
    pieces: Int[np.ndarray, "n 2"], sums: Float[np.ndarray, "m1 6"], breaks: Int[np.ndarray, " b"], rules: Rules
) -> Int[np.ndarray, "n 2"]:
    """Move each cut between two pieces that touch to where their two lines fit best, all cuts at once.

    Where a wall bends by a degree or two the gain at any scale is flat, and its peak lies many beams off the bend: a
    line over the beams of two walls is wrong by the same amount in scan after scan. In a round a cut takes at most
    half of the beams that its neighbours can spare; most stay where they are at once, and none moves more often than
    there are beams.
    """
    n = len(pieces)
    is_break = np.zeros(len(sums), np.bool_)
    is_break[breaks] = True
    for _ in range(len(sums)):
        moved, is_still = pieces.copy(), True
        for k in range(n - 1):
            cut = pieces[k, 1]
            if cut != pieces[k + 1, 0] or is_break[cut]:
                continue
            before = (cut - pieces[k, 0] - rules.least_beams) // 2
            after = (pieces[k + 1, 1] - cut - rules.least_beams) // 2
            best, least = cut, np.inf
            for at in range(cut - before, cut + after + 1):
                two = chi2_of_run(sums, pieces[k, 0], at) + chi2_of_run(sums, at, pieces[k + 1, 1])
                if two < least:
                    best, least = at, two
            moved[k, 1] = moved[k + 1, 0] = best
            is_still &= best == cut
        pieces = moved
        if is_still:
            break
    return pieces
