"""Walls that run on past the place where their lines cross: the loops of `bends`."""

import math

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled


@compiled
def overlapping(
    rows: Int[np.ndarray, " k"],
    means: Float[np.ndarray, "n 2"],
    ends: Float[np.ndarray, "n 2 2"],
    resolution_m: float,
    most_rad: float,
) -> tuple[Int[np.ndarray, "p 2"], Float[np.ndarray, "p 2"]]:
    """Return the pairs of `rows`, the wall before a bend first, which reach past where their lines cross; and where.

    They overlap by more than ends are uncertain, neither beside the whole of the other, and turn by less than
    `most_rad`: there one face would hide the other past the crossing.
    """
    alpha = means[:, 0]
    pairs, points, count = np.empty((8, 2), np.int64), np.empty((8, 2)), 0
    for before in rows:
        tx, ty = -math.sin(alpha[before]), math.cos(alpha[before])
        x, y = ends[before, 1]
        length = math.hypot(x - ends[before, 0, 0], y - ends[before, 0, 1])
        for after in rows:
            east, north = ends[after, 0, 0] - x, ends[after, 0, 1] - y
            gap, across = tx * east + ty * north, ty * east - tx * north
            overlap = -length < gap < -resolution_m
            if not overlap or tx * (ends[after, 1, 0] - x) + ty * (ends[after, 1, 1] - y) <= 0.0:
                continue
            off = alpha[after] - alpha[before]
            turn = math.atan2(math.sin(off), math.cos(off))
            if not 0.0 < abs(turn) < most_rad:
                continue
            crossing = gap + across / math.tan(turn)
            if gap - resolution_m < crossing < resolution_m:
                if count == len(pairs):
                    pairs, points = np.concatenate((pairs, pairs)), np.concatenate((points, points))
                pairs[count, 0], pairs[count, 1] = before, after
                points[count, 0], points[count, 1] = x + crossing * tx, y + crossing * ty
                count += 1
    return pairs[:count].copy(), points[:count].copy()
