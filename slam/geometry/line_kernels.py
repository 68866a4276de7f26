"""Lines (alpha rad, r m) in compiled loops."""

import math

import numpy as np
from jaxtyping import Bool, Float

from .compiled import compiled

GRAZING = 0.05
"""Sine of the angle, 3 degrees, below which two lines, or a beam and a line, are taken for parallel: an error of one in
place moves their crossing by twenty times as much."""


@compiled
def intersect(
    one: Float[np.ndarray, "k 2"], other: Float[np.ndarray, "k 2"]
) -> tuple[Float[np.ndarray, "k 2"], Bool[np.ndarray, " k"]]:
    """Return where pairs of lines cross, and which are too near to parallel (`GRAZING`)."""
    points, parallel = np.empty((len(one), 2)), np.empty(len(one), np.bool_)
    for k in range(len(one)):
        det = math.sin(other[k, 0] - one[k, 0])
        parallel[k] = abs(det) < GRAZING
        safe = 1.0 if parallel[k] else det
        points[k, 0] = (one[k, 1] * math.sin(other[k, 0]) - other[k, 1] * math.sin(one[k, 0])) / safe
        points[k, 1] = (other[k, 1] * math.cos(one[k, 0]) - one[k, 1] * math.cos(other[k, 0])) / safe
    return points, parallel


@compiled
def lines_from(
    pose_world: Float[np.ndarray, "3"], anchors: Float[np.ndarray, "n 2"], means: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
    """Return walls as lines (alpha, r) from a pose, and where its perpendiculars meet them, m from their anchors."""
    lines, feet = np.empty((len(means), 2)), np.empty(len(means))
    for k in range(len(means)):
        c, s = math.cos(means[k, 0]), math.sin(means[k, 0])
        east, north = pose_world[0] - anchors[k, 0], pose_world[1] - anchors[k, 1]
        lines[k, 0], lines[k, 1] = means[k, 0] - pose_world[2], means[k, 1] - c * east - s * north
        feet[k] = c * north - s * east
    return lines, feet
