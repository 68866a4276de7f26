"""Where walls begin and end, and how far they are: the loops of `stochastic_map`."""

import math

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled
from ...geometry.numerics import TINY


@compiled
def ends_world(
    anchors: Float[np.ndarray, "n 2"], means: Float[np.ndarray, "n 2"], extents: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 2 2"]:
    """Return the first and last point of walls, world frame, m: walking on, the free side is on the left."""
    ends = np.empty((len(means), 2, 2))
    for k in range(len(means)):
        nx, ny = math.cos(means[k, 0]), math.sin(means[k, 0])
        for side in range(2):
            ends[k, side, 0] = anchors[k, 0] + means[k, 1] * nx - extents[k, side] * ny
            ends[k, side, 1] = anchors[k, 1] + means[k, 1] * ny + extents[k, side] * nx
    return ends


@compiled
def distances(point_world: Float[np.ndarray, "2"], ends: Float[np.ndarray, "n 2 2"]) -> Float[np.ndarray, " n"]:
    """Return the distance from a point to each wall, m."""
    found = np.empty(len(ends))
    for k in range(len(ends)):
        along_x, along_y = ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1]
        x, y = point_world[0] - ends[k, 0, 0], point_world[1] - ends[k, 0, 1]
        share = (x * along_x + y * along_y) / max(along_x**2 + along_y**2, TINY**2)
        share = min(max(share, 0.0), 1.0)
        found[k] = math.hypot(x - share * along_x, y - share * along_y)
    return found


@compiled
def across(
    ends: Float[np.ndarray, "n 2 2"], anchors: Float[np.ndarray, "n 2"], means: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 2"]:
    """Return how far (m) beyond its two ends, along its normal, the line (alpha rad, d m) of each wall lies now."""
    found = np.empty((len(means), 2))
    for k in range(len(means)):
        nx, ny = math.cos(means[k, 0]), math.sin(means[k, 0])
        for end in range(2):
            x, y = ends[k, end, 0] - anchors[k, 0], ends[k, end, 1] - anchors[k, 1]
            found[k, end] = means[k, 1] - (nx * x + ny * y)
    return found


@compiled
def moved(
    placed: Float[np.ndarray, "n 2"],
    extents: Float[np.ndarray, "n 2"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    long_m: float,
) -> tuple[Int[np.ndarray, " t"], Float[np.ndarray, "t 2 2"], Float[np.ndarray, "t 2"]]:
    """Return the long walls, where their ends lie by the lines on which they were `placed`, and how far `across` these.

    A wall that was placed nowhere yet is placed on its line.
    """
    for k in range(len(placed)):
        if math.isnan(placed[k, 0]):
            placed[k] = means[k]
    tell = np.flatnonzero(extents[:, 1] - extents[:, 0] >= long_m)
    ends = ends_world(anchors[tell], placed[tell], extents[tell])
    return tell, ends, across(ends, anchors[tell], means[tell])
