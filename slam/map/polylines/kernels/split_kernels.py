"""Where the beams of all scans lie along a wall, and where two lines fit them better than one: loops of `splits`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ....geometry.compiled import compiled

Bins = Float[np.ndarray, "5 p"]
"""Sums over the beams in each piece of a wall: weights, these by along, by across, by across squared; and the count."""


class Fit(NamedTuple):
    """A line through some pieces."""

    along: float
    """Its middle, m."""
    across: float
    slope: float
    across_var: float
    slope_var: float
    chi_square: float
    """Of the beams."""
    beams: float


@compiled
def placed(
    lines: Float[np.ndarray, "m 2"],
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "m 2"],
    references: Float[np.ndarray, "m 2"],
    feet: Float[np.ndarray, " m"],
    along: Float[np.ndarray, " k"],
    across: Float[np.ndarray, " k"],
    of: Int[np.ndarray, " k"],
) -> Float[np.ndarray, "2 k"]:
    """Return how far along and across reference lines (alpha, d) beams end, m from the anchors, wherever they are seen.

    Of each beam it is told where it meets the seen line `of` it, m from the same origin as that line's foot, and by
    how much it misses it.
    """
    ends = np.empty((2, len(along)))
    for k in range(len(along)):
        m = of[k]
        turned, forward, aside = lines[m, 0] + pose_world[2], lines[m, 1] + across[k], along[k] - feet[m]
        east = pose_world[0] + forward * math.cos(turned) - aside * math.sin(turned) - anchors[m, 0]
        north = pose_world[1] + forward * math.sin(turned) + aside * math.cos(turned) - anchors[m, 1]
        c, s = math.cos(references[m, 0]), math.sin(references[m, 0])
        ends[0, k] = c * north - s * east
        ends[1, k] = c * east + s * north - references[m, 1]
    return ends


@compiled
def binned(ends: Float[np.ndarray, "2 k"], weights: Float[np.ndarray, " k"], pitch_m: float) -> tuple[int, Bins]:
    """Return the sums of beams in pieces of this length, and the number of the first piece."""
    first, last = math.floor(np.min(ends[0]) / pitch_m), math.floor(np.max(ends[0]) / pitch_m)
    bins = np.zeros((5, last - first + 1))
    for k in range(len(weights)):
        piece = math.floor(ends[0, k] / pitch_m) - first
        bins[0, piece] += weights[k]
        bins[1, piece] += weights[k] * ends[0, k]
        bins[2, piece] += weights[k] * ends[1, k]
        bins[3, piece] += weights[k] * ends[1, k] * ends[1, k]
        bins[4, piece] += 1.0
    return first, bins


@compiled
def fitted(bins: Bins, first: int, last: int, off_m: float) -> Fit:
    """Return the line through the pieces from `first` to before `last`, each of which may be off by `off_m`, sigma.

    What is not known has an infinite variance: the slope of less than two pieces, and all of none.
    """
    total, along, across, chi_square, beams = 0.0, 0.0, 0.0, 0.0, 0.0
    for piece in range(first, last):
        if bins[0, piece] > 0.0:
            weight = 1.0 / (1.0 / bins[0, piece] + off_m * off_m)
            total += weight
            along += weight * bins[1, piece] / bins[0, piece]
            across += weight * bins[2, piece] / bins[0, piece]
            chi_square += bins[3, piece] - bins[2, piece] * bins[2, piece] / bins[0, piece]
            beams += bins[4, piece]
    if total == 0.0:
        return Fit(0.0, 0.0, 0.0, math.inf, math.inf, 0.0, 0.0)
    along, across = along / total, across / total
    ss, sz, zz = 0.0, 0.0, 0.0
    for piece in range(first, last):
        if bins[0, piece] > 0.0:
            weight = 1.0 / (1.0 / bins[0, piece] + off_m * off_m)
            s, z = bins[1, piece] / bins[0, piece] - along, bins[2, piece] / bins[0, piece] - across
            ss, sz, zz = ss + weight * s * s, sz + weight * s * z, zz + weight * z * z
    if ss == 0.0:
        return Fit(along, across, 0.0, 1.0 / total, math.inf, chi_square + zz, beams)
    return Fit(along, across, sz / ss, 1.0 / total, 1.0 / ss, chi_square + zz - sz * sz / ss, beams)


@compiled
def best_split(bins: Bins, first: int, last: int, reach: int, least: int) -> tuple[int, float]:
    """Return before which piece from `first` to before `last` two lines fit better than one, and by how much.

    In chi-square, over at most `reach` pieces on either side of it, of which `least` hold beams; one of the sides ends
    within `reach`.
    """
    best, most = first, 0.0
    for at in range(first + least, last - least + 1):
        if min(at - first, last - at) > reach:
            continue
        start, stop = max(at - reach, first), min(at + reach, last)
        if min(_held(bins, start, at), _held(bins, at, stop)) >= least:
            two = fitted(bins, start, at, 0.0).chi_square + fitted(bins, at, stop, 0.0).chi_square
            gain = fitted(bins, start, stop, 0.0).chi_square - two
            if gain > most:
                best, most = at, gain
    return best, most


@compiled
def _held(bins: Bins, first: int, last: int) -> int:
    held = 0
    for piece in range(first, last):
        if bins[0, piece] > 0.0:
            held += 1
    return held
