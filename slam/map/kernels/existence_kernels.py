"""What looks say of whether walls exist: the loops of `existence`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.line_kernels import GRAZING, lines_from


class Odds(NamedTuple):
    """The numbers of `ExistenceConfig` that the loops read, as logarithms of odds."""

    seen: float
    missed: float
    most: float
    beams: int
    apart_m: float
    margin_m: float


@compiled
def crossing(
    bearings_rad: Float[np.ndarray, " k"],
    passed_m: Float[np.ndarray, " k"],
    range_m: float,
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    extents: Float[np.ndarray, "n 2"],
    margin_m: float,
) -> Int[np.ndarray, " n"]:
    """Return how many beams reach each wall between its ends: they end on it, or go on beyond it."""
    counts = np.zeros(len(means), np.int64)
    x, y = np.cos(bearings_rad), np.sin(bearings_rad)
    lines, feet = lines_from(pose_world, anchors, means)
    for n in range(len(means)):
        nx, ny, r = math.cos(lines[n, 0]), math.sin(lines[n, 0]), lines[n, 1]
        if r <= 0.0 or r > range_m or feet[n] + range_m < extents[n, 0] or feet[n] - range_m > extents[n, 1]:
            continue
        for beam in range(len(bearings_rad)):
            cosine = x[beam] * nx + y[beam] * ny
            if cosine <= GRAZING:
                continue
            distance = r / cosine
            along = feet[n] + distance * (y[beam] * nx - x[beam] * ny)
            reaches = (passed_m[beam] - distance) * cosine >= -margin_m
            counts[n] += reaches and extents[n, 0] < along < extents[n, 1]
    return counts


@compiled
def look(
    pose_world: Float[np.ndarray, "3"],
    beams: Int[np.ndarray, " n"],
    seen: Bool[np.ndarray, " n"],
    log_odds: Float[np.ndarray, " n"],
    places: Float[np.ndarray, "n 2"],
    odds: Odds,
) -> None:
    """Take one scan into the log odds of walls, in place; `beams` reach each, and `seen` are those that it showed.

    The scan in which a wall begins is no look at it: its place is not a number.
    """
    for n in range(len(log_odds)):
        if math.isnan(places[n, 0]):
            places[n] = np.inf
            continue
        if not seen[n] and beams[n] < odds.beams:
            continue
        if math.hypot(pose_world[0] - places[n, 0], pose_world[1] - places[n, 1]) < odds.apart_m:
            continue
        places[n, 0], places[n, 1] = pose_world[0], pose_world[1]
        log_odds[n] = min(log_odds[n] + (odds.seen if seen[n] else odds.missed), odds.most)
