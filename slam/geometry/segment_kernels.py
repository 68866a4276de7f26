"""Loops over points and segments."""

import numpy as np
from jaxtyping import Bool, Float

from .compiled import compiled


@compiled
def lie_beside(
    points: Float[np.ndarray, "p 2"],
    point_normals: Float[np.ndarray, "p 2"],
    segments: Float[np.ndarray, "n 2 2"],
    segment_normals: Float[np.ndarray, "n 2"],
    reach_m: float,
    least_cosine: float,
) -> Bool[np.ndarray, " p"]:
    """Return which points lie within reach of a segment whose normal agrees with theirs, by the cosine between them."""
    beside = np.zeros(len(points), dtype=np.bool_)
    for p in range(len(points)):
        x, y = points[p]
        for n in range(len(segments)):
            ax, ay = x - segments[n, 0, 0], y - segments[n, 0, 1]
            bx, by = x - segments[n, 1, 0], y - segments[n, 1, 1]
            if min(ax, bx) > reach_m or max(ax, bx) < -reach_m or min(ay, by) > reach_m or max(ay, by) < -reach_m:
                continue
            if point_normals[p, 0] * segment_normals[n, 0] + point_normals[p, 1] * segment_normals[n, 1] < least_cosine:
                continue
            along_x, along_y = ax - bx, ay - by
            squared = along_x * along_x + along_y * along_y
            share = min(max((ax * along_x + ay * along_y) / squared, 0.0), 1.0) if squared > 0.0 else 0.0
            off_x, off_y = ax - share * along_x, ay - share * along_y
            if off_x * off_x + off_y * off_y <= reach_m * reach_m:
                beside[p] = True
                break
    return beside
