"""Lines (alpha rad, r m) with n(alpha)·x = r, and segments as pairs of points.

The normal points from the free side into the wall, so a line knows the side from which it was seen; the
direction of travel with the free side on the left is t = J n.
"""

import numpy as np
from jaxtyping import Float

from .numerics import TINY
from .poses import wrap


def normals(alpha: Float[np.ndarray, "*n"] | np.floating) -> Float[np.ndarray, "*n 2"]:
    """Return the unit normals n(alpha), pointing into the wall."""
    return _vectors(np.cos(alpha), np.sin(alpha))


def directions(alpha: Float[np.ndarray, "*n"] | np.floating) -> Float[np.ndarray, "*n 2"]:
    """Return the unit vectors t = J n(alpha) along the lines, free side on the left."""
    return _vectors(-np.sin(alpha), np.cos(alpha))


def _vectors(
    x: Float[np.ndarray, "*n"] | np.floating, y: Float[np.ndarray, "*n"] | np.floating
) -> Float[np.ndarray, "*n 2"]:
    vectors = np.empty((*x.shape, 2))  # a fifth of what np.stack takes, dozens of times in a step
    vectors[..., 0], vectors[..., 1] = x, y
    return vectors


def through(segments: Float[np.ndarray, "n 2 2"]) -> Float[np.ndarray, "n 2"]:
    """Return the lines (alpha, r) through segments that are ordered with the free side on the left."""
    along = segments[:, 1] - segments[:, 0]
    alpha = np.arctan2(-along[:, 0], along[:, 1])
    return _vectors(alpha, np.vecdot(normals(alpha), segments[:, 0]))


def lines_to_world(
    lines_robot: Float[np.ndarray, "n 2"], pose_world: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "n 2"]:
    """Return robot-frame lines in the world frame; there r may be negative."""
    alpha = wrap(lines_robot[:, 0] + pose_world[2])
    return _vectors(alpha, lines_robot[:, 1] + normals(alpha) @ pose_world[:2])


def project(points: Float[np.ndarray, "*n 2"], lines: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
    """Return the feet of the perpendiculars from points to their lines."""
    n = normals(lines[..., 0])
    off = np.vecdot(n, points) - lines[..., 1]
    return points - off[..., None] * n


def distance_to_segments(
    points: Float[np.ndarray, "m 2"], segments: Float[np.ndarray, "n 2 2"]
) -> Float[np.ndarray, "m n"]:
    """Return the distance from each point to each segment."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    squared = np.maximum(np.vecdot(along, along), TINY**2)
    offset = points[:, None, :] - start
    share = np.clip(np.vecdot(offset, along) / squared, 0.0, 1.0)
    gap = offset - share[..., None] * along
    return np.hypot(gap[..., 0], gap[..., 1])
