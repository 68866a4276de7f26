"""What looks say of whether walls exist: the loops of `existence`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled


class Odds(NamedTuple):
    """The numbers of `ExistenceConfig` that the loops read, as logarithms of odds."""

    seen: float
    missed: float
    most: float
    beams: int
    apart_m: float
    margin_m: float


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
