"""What looks say of whether walls exist: the loops of `existence`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.line_kernels import GRAZING


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
    counts, k = np.zeros(len(means), np.int64), len(bearings_rad)
    x, y = np.empty(k), np.empty(k)
    for beam in range(k):
        x[beam], y[beam] = math.cos(bearings_rad[beam] + pose_world[2]), math.sin(bearings_rad[beam] + pose_world[2])
    for n in range(len(means)):
        nx, ny = math.cos(means[n, 0]), math.sin(means[n, 0])
        east, north = anchors[n, 0] - pose_world[0], anchors[n, 1] - pose_world[1]
        r, foot = means[n, 1] + nx * east + ny * north, ny * east - nx * north
        farthest = max(-extents[n, 0], extents[n, 1])
        if r <= 0.0 or math.hypot(east, north) - farthest > range_m:
            continue
        for beam in range(k):
            cosine = x[beam] * nx + y[beam] * ny
            if cosine <= GRAZING:
                continue
            distance = r / cosine
            along = foot + distance * (y[beam] * nx - x[beam] * ny)
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
