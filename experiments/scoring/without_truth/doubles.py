"""Duplicate walls of a map by their geometry alone, for drives without ground truth."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import directions, normals, through
from chainslam.slam.geometry.numerics import TINY
from chainslam.slam.geometry.poses import wrap

TURN_RAD = float(np.deg2rad(5.0))
"""Lines with a larger difference in direction are different walls."""
APART_M = 0.2
"""Two lines facing one way that are farther apart may well be two walls, such as those of a niche."""
OVERLAP_M = 0.2
"""On a shorter stretch, a landmark that was extended too far may overlap the next wall."""


def doubles(ends_world: Float[np.ndarray, "n 2 2"]) -> list[tuple[int, int]]:
    """Return the rows (earlier, later) of lines that overlap an earlier one of the same side over 0.2 m or more.

    Each line is counted once, with the first one that it doubles: their directions differ by less than 5 degrees, and
    where they overlap they are less than 0.2 m apart. Ends (m, world frame) have the free side on the left.
    """
    n = len(ends_world)
    if n < 2:
        return []
    lines = through(ends_world)
    found = []
    for later in range(1, n):
        alpha = lines[later, 0]
        along = np.sort(ends_world[: later + 1] @ directions(alpha), axis=1)
        low, high = np.maximum(along[:later, 0], along[later, 0]), np.minimum(along[:later, 1], along[later, 1])
        one_way = np.abs(wrap(lines[:later, 0] - alpha)) < TURN_RAD
        middle = 0.5 * (low + high)
        apart = np.abs(_across_at(ends_world[:later], alpha, middle) - lines[later, 1])
        first = np.flatnonzero(one_way & (high - low >= OVERLAP_M) & (apart < APART_M))
        if len(first):
            found.append((int(first[0]), later))
    return found


def _across_at(
    ends: Float[np.ndarray, "m 2 2"], alpha: np.floating, along_m: Float[np.ndarray, " m"]
) -> Float[np.ndarray, " m"]:
    """Return how far off along the normal of `alpha` each line is, where it passes `along_m` along `alpha`'s line."""
    t, across = ends @ directions(alpha), ends @ normals(alpha)
    length = np.where(np.abs(t[:, 1] - t[:, 0]) > TINY, t[:, 1] - t[:, 0], TINY)
    share = (along_m - t[:, 0]) / length
    return np.asarray(across[:, 0] + share * (across[:, 1] - across[:, 0]))
