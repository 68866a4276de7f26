"""How far the ends of the segments of one scan can be believed."""

import numpy as np
from jaxtyping import Bool, Float

from ...geometry.compiled import compiled

_GRAZING = 0.02
"""Cosine between beam and normal below which it is taken for this: there a beam meets a line nowhere."""


@compiled
def believed_ends(
    lines: Float[np.ndarray, "n 2"],
    ends: Float[np.ndarray, "n 2 2"],
    at_corner: Bool[np.ndarray, "n 2"],
    last_rad: Float[np.ndarray, "n 2"],
    step_rad: float,
    sure_gap_m: float,
    corner_leap_m: float,
) -> tuple[Float[np.ndarray, "n 2 2"], Bool[np.ndarray, "n 2"]]:
    """Return ends without what lies beyond the last beams (`last_rad`) or where beams stand apart; which are a corner.

    Beams dtheta apart meet a line at distance r, s beyond the foot of the perpendicular, (r^2 + s^2) dtheta / r apart.
    """
    believed, at_corner = ends.copy(), at_corner.copy()
    for k in range(len(lines)):
        alpha, r = lines[k]
        c, s = np.cos(alpha), np.sin(alpha)
        for end in range(2):
            bearing = last_rad[k, end]
            distance = r / max(np.cos(bearing - alpha), _GRAZING)
            x, y = distance * np.cos(bearing), distance * np.sin(bearing)
            leap = np.hypot(ends[k, end, 0] - x, ends[k, end, 1] - y)
            if leap > corner_leap_m:
                believed[k, end, 0], believed[k, end, 1], at_corner[k, end] = x, y, False
        along = c * believed[k, :, 1] - s * believed[k, :, 0]
        farthest = np.sqrt(max(r * sure_gap_m / step_rad - r * r, 0.0))
        if along[0] * along[1] > 0.0:
            farthest = max(farthest, min(abs(along[0]), abs(along[1])))
        for end in range(2):
            clipped = min(max(along[end], -farthest), farthest)
            is_cut = clipped != along[end]
            if is_cut:
                believed[k, end, 0], believed[k, end, 1] = r * c - clipped * s, r * s + clipped * c
                at_corner[k, end] = False
    return believed, at_corner
