"""Which walls lie near a segment of a scan: the loop of `view.near_segments`."""

import math

import numpy as np
from jaxtyping import Bool, Float

from ...geometry.compiled import compiled
from ...geometry.segment_kernels import apart


@compiled
def near_segments(
    ends_robot: Float[np.ndarray, "s 2 2"],
    ends_world: Float[np.ndarray, "n 2 2"],
    pose_world: Float[np.ndarray, "3"],
    off_m: float,
    off_rad: float,
) -> Bool[np.ndarray, " n"]:
    """Return which walls lie nearer to a segment than `off_m` and what a turn by `off_rad` moves its farther end."""
    near = np.zeros(len(ends_world), np.bool_)
    c, s = math.cos(pose_world[2]), math.sin(pose_world[2])
    seen = np.empty((2, 2))
    for k in range(len(ends_robot)):
        away_m = 0.0
        for end in range(2):
            x, y = ends_robot[k, end]
            away_m = max(away_m, math.hypot(x, y))
            seen[end, 0], seen[end, 1] = c * x - s * y + pose_world[0], s * x + c * y + pose_world[1]
        reach_m = off_m + away_m * off_rad
        for n in range(len(ends_world)):
            near[n] = near[n] or (_may_reach(seen, ends_world[n], reach_m) and apart(seen, ends_world[n]) < reach_m)
    return near


@compiled
def _may_reach(one: Float[np.ndarray, "2 2"], other: Float[np.ndarray, "2 2"], reach_m: float) -> bool:
    """Return whether the boxes around two segments are no farther apart than this along either axis."""
    for i in range(2):
        if min(one[0, i], one[1, i]) - max(other[0, i], other[1, i]) > reach_m:
            return False
        if min(other[0, i], other[1, i]) - max(one[0, i], one[1, i]) > reach_m:
            return False
    return True
