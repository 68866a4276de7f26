"""Observations judged by the others: each given all of the rest, and each against its rivals for one segment."""

import math

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import squared_distance, whitening

UNMATCHED = -1
"""In the place of a candidate, where there is none."""


@compiled
def judged_by_the_rest(
    chosen: Int[np.ndarray, " m"], e: Float[np.ndarray, " k"], S: Float[np.ndarray, "k k"]
) -> tuple[float, Float[np.ndarray, " m"]]:
    """Return the squared distance of m observations taken together, and that of each given all others."""
    m = len(chosen)
    part, left = np.empty((2 * m, 2 * m)), np.empty(2 * m)
    for i in range(2 * m):
        left[i] = e[2 * chosen[i // 2] + i % 2]
        for j in range(2 * m):
            part[i, j] = S[2 * chosen[i // 2] + i % 2, 2 * chosen[j // 2] + j % 2]
    W = whitening(part)
    squared, white = 0.0, np.zeros(2 * m)
    for i in range(2 * m):
        for j in range(i + 1):
            white[i] += W[i, j] * left[j]
        squared += white[i] * white[i]
    losses = np.empty(m)
    for o in range(m):
        a, b, s00, s01, s11 = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(2 * o, 2 * m):
            a += W[i, 2 * o] * white[i]
            b += W[i, 2 * o + 1] * white[i]
            s00 += W[i, 2 * o] * W[i, 2 * o]
            s01 += W[i, 2 * o] * W[i, 2 * o + 1]
            s11 += W[i, 2 * o + 1] * W[i, 2 * o + 1]
        # What the sum of squares loses when one observation is left out is its own, given all others.
        losses[o] = squared_distance(a, b, s00, s01, s11)
    return squared, losses


@compiled
def compatible(
    rows: Int[np.ndarray, " r"],
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    level: float,
    levels: Float[np.ndarray, " l"],
) -> Int[np.ndarray, " k"]:
    """Drop of some rows of e the worst first, until each passes the gate's `level` given all others.

    And all together the level of so many of them in `levels`: a bad slip alone takes all together far out. After a step
    in which the wheels may have slipped by a degree each wall alone allows for that error; the other walls tell what it
    was. Returns the rows of those that are left.
    """
    kept = rows.copy()
    while len(kept) > 1:
        squared, losses = judged_by_the_rest(kept, e, S)
        worst = np.argmax(losses)
        if squared <= levels[len(kept)] and losses[worst] <= level:
            break
        kept[worst:-1] = kept[worst + 1 :].copy()
        kept = kept[:-1].copy()
    return kept


@compiled
def nearest_alone(
    segment: Int[np.ndarray, " c"],
    d2: Float[np.ndarray, " c"],
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    R: Float[np.ndarray, "c 2 2"],
    one_wall: float,
    clear: float,
) -> Int[np.ndarray, " k"]:
    """Return for each segment its nearest candidate, unless another wall costs hardly more (by less than `clear`).

    Two landmarks of one wall are not another: by the level `one_wall` their covariance does not tell them apart. `R` is
    the noise of each candidate's segment, which is the same for all candidates of one. Segments ascend.
    """
    alone, kept, start = np.empty(len(segment), np.int64), 0, 0
    while start < len(segment):
        best, stop = start, start
        while stop < len(segment) and segment[stop] == segment[start]:
            best = stop if d2[stop] < d2[best] else best
            stop += 1
        is_alone = True
        for c in range(start, stop):
            differ = c != best and apart(c, best, e, S, R) > one_wall
            rivals = differ and d2[c] < d2[best] + clear
            is_alone = is_alone and not rivals
        if is_alone:
            alone[kept] = best
            kept += 1
        start = stop
    return alone[:kept].copy()


@compiled
def apart(
    one: int,
    other: int,
    e: Float[np.ndarray, " k"],
    S: Float[np.ndarray, "k k"],
    R: Float[np.ndarray, "c 2 2"],
) -> float:
    """Return the squared distance between two candidates of one segment, along axes of which anything is uncertain."""
    i, j = 2 * one, 2 * other
    c00 = S[i, i] + S[j, j] - 2.0 * S[i, j] - 2.0 * R[one, 0, 0]
    c01 = S[i, i + 1] + S[j, j + 1] - S[i, j + 1] - S[j, i + 1] - 2.0 * R[one, 0, 1]
    c11 = S[i + 1, i + 1] + S[j + 1, j + 1] - 2.0 * S[i + 1, j + 1] - 2.0 * R[one, 1, 1]
    turn = 0.5 * math.atan2(2.0 * c01, c00 - c11)
    cosine, sine = math.cos(turn), math.sin(turn)
    first = c00 * cosine**2 + 2.0 * c01 * cosine * sine + c11 * sine**2
    second = c00 * sine**2 - 2.0 * c01 * cosine * sine + c11 * cosine**2
    least = 1e-15 * max(abs(first), abs(second))
    a, b = e[i] - e[j], e[i + 1] - e[j + 1]
    squared = 0.0
    if abs(first) > least:
        squared += (cosine * a + sine * b) ** 2 / first
    if abs(second) > least:
        squared += (cosine * b - sine * a) ** 2 / second
    return squared


@compiled
def own_distance(c: int, e: Float[np.ndarray, " k"], S: Float[np.ndarray, "k k"]) -> float:
    """Return the squared Mahalanobis distance of one observation by itself."""
    i = 2 * c
    return squared_distance(e[i], e[i + 1], S[i, i], S[i, i + 1], S[i + 1, i + 1])
