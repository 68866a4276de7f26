"""Which ends of walls may be joined, and where they meet: the loops of `chains`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.line_kernels import intersect

TAIL, HEAD = 0, 1
"""The two ends of a wall: walking from tail to head, the free side is on the left."""


class Reach(NamedTuple):
    """The numbers of `SharedConfig` that the loops read."""

    reach_m: float
    """Largest distance between two ends that are joined while the robot still explores them."""
    set_aside_reach_m: float
    """The same for two ends that exploration looked at closely and set aside."""


@compiled
def linked(
    ends: Float[np.ndarray, "n 2 2"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    aside: Bool[np.ndarray, "n 2"],
    near_m: float,
    corner_m: float,
    reach: Reach,
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " c"], Bool[np.ndarray, " r"], Float[np.ndarray, "n 2"]]:
    """Return the `runs` of walls that are joined, and where each of them meets the next, of which ends are set aside.

    Only ends within `near_m` are looked at; of two walls the lines cross within `corner_m` of both ends, or the corner
    is amid these.
    """
    pairs = near_ends(ends, near_m)
    both_aside = np.zeros(len(pairs), np.bool_)
    for k in range(len(pairs)):
        both_aside[k] = aside[pairs[k, 0], HEAD] and aside[pairs[k, 1], TAIL]
    alpha, lines = means[:, 0].copy(), means.copy()
    lines[:, 1] += np.cos(alpha) * anchors[:, 0] + np.sin(alpha) * anchors[:, 1]
    gaps, allowed = joinable(pairs, ends, both_aside, reach)
    successor = successors(pairs, gaps, allowed, len(ends))
    before = np.flatnonzero(successor >= 0)
    after = successor[before]
    heads, tails = ends[:, HEAD].copy()[before], ends[:, TAIL].copy()[after]
    corners = np.full((len(ends), 2), np.nan)
    corners[before] = corner_points(lines[before], lines[after], heads, tails, corner_m)
    walked, starts, closed = runs(successor)
    return walked, starts, closed, corners[walked]


@compiled
def near_ends(ends: Float[np.ndarray, "n 2 2"], reach_m: float) -> Int[np.ndarray, "k 2"]:
    """Return the pairs (head of one, tail of another) that are as near, ascending."""
    n = len(ends)
    order = np.argsort(ends[:, TAIL, 0])
    eastings = ends[:, TAIL, 0][order]
    pairs, count = np.empty((4 * n, 2), np.int64), 0
    for head in range(n):
        x, y = ends[head, HEAD]
        first = count
        for at in range(np.searchsorted(eastings, x - reach_m), n):
            if eastings[at] > x + reach_m:
                break
            tail = order[at]
            if tail == head or math.hypot(ends[tail, TAIL, 0] - x, ends[tail, TAIL, 1] - y) > reach_m:
                continue
            if count == len(pairs):
                pairs = np.concatenate((pairs, np.empty((len(pairs), 2), np.int64)))
            place = count
            while place > first and pairs[place - 1, 1] > tail:
                pairs[place] = pairs[place - 1]
                place -= 1
            pairs[place, 0], pairs[place, 1] = head, tail
            count += 1
    return pairs[:count].copy()


@compiled
def joinable(
    pairs: Int[np.ndarray, "k 2"],
    ends: Float[np.ndarray, "n 2 2"],
    both_aside: Bool[np.ndarray, " k"],
    reach: Reach,
) -> tuple[Float[np.ndarray, " k"], Bool[np.ndarray, " k"]]:
    """Return the gap of each pair, m, and whether the two ends may be joined."""
    gaps, allowed = np.empty(len(pairs)), np.zeros(len(pairs), np.bool_)
    for k in range(len(pairs)):
        head, tail = pairs[k]
        east, north = ends[tail, TAIL, 0] - ends[head, HEAD, 0], ends[tail, TAIL, 1] - ends[head, HEAD, 1]
        gap = math.hypot(east, north)
        gaps[k], allowed[k] = gap, gap <= (reach.set_aside_reach_m if both_aside[k] else reach.reach_m)
    return gaps, allowed


@compiled
def successors(
    pairs: Int[np.ndarray, "k 2"], gaps: Float[np.ndarray, " k"], allowed: Bool[np.ndarray, " k"], count: int
) -> Int[np.ndarray, " n"]:
    """Return the row of each wall's successor, -1 for none: greedily, nearest ends first, of equals the first."""
    successor, taken = np.full(count, -1), np.zeros(count, np.bool_)
    rows = np.flatnonzero(allowed)
    for k in rows[np.argsort(gaps[rows], kind="mergesort")]:
        before, after = pairs[k]
        if successor[before] < 0 and not taken[after]:
            successor[before], taken[after] = after, True
    return successor


@compiled
def corner_points(
    before: Float[np.ndarray, "k 2"],
    after: Float[np.ndarray, "k 2"],
    heads: Float[np.ndarray, "k 2"],
    tails: Float[np.ndarray, "k 2"],
    reach_m: float,
) -> Float[np.ndarray, "k 2"]:
    """Return where neighbouring walls meet: the intersection of their lines if it lies near both ends."""
    points, parallel = intersect(before, after)
    for k in range(len(points)):
        x, y = points[k]
        far = max(math.hypot(x - heads[k, 0], y - heads[k, 1]), math.hypot(x - tails[k, 0], y - tails[k, 1])) > reach_m
        if parallel[k] or far:
            points[k] = 0.5 * (heads[k] + tails[k])
    return points


@compiled
def runs(
    successor: Int[np.ndarray, " n"],
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " c"], Bool[np.ndarray, " r"]]:
    """Follow the links: the rows of all chains, one chain after another in the order of their least rows.

    And where each begins among them, with an end more, and which are closed; those begin with their least row.
    """
    n = len(successor)
    is_first, done = np.ones(n, np.bool_), np.zeros(n, np.bool_)
    for row in range(n):
        if successor[row] >= 0:
            is_first[successor[row]] = False
    walked, least, bounds, count, at = np.empty(n, np.int64), np.empty(n, np.int64), np.zeros(n + 1, np.int64), 0, 0
    closed = np.zeros(n, np.bool_)
    for begin in range(2 * n):
        # Open chains from their beginnings, then the closed ones.
        row = begin % n
        if done[row] or (begin < n and not is_first[row]):
            continue
        least[count] = row
        while row >= 0 and not done[row]:
            done[row], walked[at] = True, row
            least[count], at, row = min(least[count], row), at + 1, successor[row]
        closed[count] = row == begin % n
        count += 1
        bounds[count] = at
    order = np.argsort(least[:count])
    rows, starts, place = np.empty(n, np.int64), np.zeros(count + 1, np.int64), 0
    for k in range(count):
        for at in range(bounds[order[k]], bounds[order[k] + 1]):
            rows[place] = walked[at]
            place += 1
        starts[k + 1] = place
    return rows, starts, closed[order]
