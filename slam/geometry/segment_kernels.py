"""Loops over points and segments."""

import math

import numpy as np
from jaxtyping import Bool, Float

from .compiled import compiled
from .numerics import TINY


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


@compiled
def segment_distances(one: Float[np.ndarray, "m 2 2"], other: Float[np.ndarray, "n 2 2"]) -> Float[np.ndarray, "m n"]:
    """Return the least distance between each segment of the one and each of the other; 0 where they cross."""
    found = np.empty((len(one), len(other)))
    for m in range(len(one)):
        for n in range(len(other)):
            found[m, n] = apart(one[m], other[n])
    return found


@compiled
def apart(one: Float[np.ndarray, "2 2"], other: Float[np.ndarray, "2 2"]) -> float:
    """Return the least distance between two segments; 0 where they cross."""
    crosses, least = True, math.inf
    for a, b in ((one, other), (other, one)):
        along_x, along_y = b[1, 0] - b[0, 0], b[1, 1] - b[0, 1]
        sides = 1.0
        for end in range(2):
            x, y = a[end, 0] - b[0, 0], a[end, 1] - b[0, 1]
            share = (x * along_x + y * along_y) / max(along_x * along_x + along_y * along_y, TINY**2)
            share = min(max(share, 0.0), 1.0)
            least = min(least, math.hypot(x - share * along_x, y - share * along_y))
            sides *= along_x * y - along_y * x
        crosses = crosses and sides < 0.0
    return 0.0 if crosses else least
