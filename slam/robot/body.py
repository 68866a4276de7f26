"""The room that a robot's body takes: a disc about the middle of the axle, or a convex outline.

Whatever asks how far something is from the body measures as from a disc: `reaches_m` is the distance from the middle
for a disc, and for an outline the distance to its rim and the radius. So one number of clearance means
the same for both.
"""

import numpy as np
from jaxtyping import Float

from ..geometry.poses import rotation
from .spec import RobotSpec

Points = Float[np.ndarray, "*n 2"]


def reaches_m(points_robot: Points, robot: RobotSpec) -> Float[np.ndarray, "*n"]:
    """Return the distance of points, robot frame, from the rim of the body, and the radius, m; less inside of it."""
    if robot.outline_m is None:
        return np.hypot(points_robot[..., 0], points_robot[..., 1])
    return robot.radius_m - depths_m(points_robot, robot)


def depths_m(points_robot: Points, robot: RobotSpec) -> Float[np.ndarray, "*n"]:
    """Return how far inside the body points lie, robot frame, m; below 0 for those outside."""
    if robot.outline_m is None:
        return robot.radius_m - np.hypot(points_robot[..., 0], points_robot[..., 1])
    corners = np.array(robot.outline_m)
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*edges.T)
    off = points_robot[..., None, :] - corners
    along = np.sum(off * edges, axis=-1) / lengths
    left = (edges[:, 0] * off[..., 1] - edges[:, 1] * off[..., 0]) / lengths
    beside = np.clip(along, 0.0, lengths) - along
    away = np.hypot(beside, left).min(axis=-1)
    return np.where(np.all(left >= 0.0, axis=-1), away, -away)


def rim_of(robot: RobotSpec, heading_rad: float, every_m: float = 0.05) -> Float[np.ndarray, "n 2"]:
    """Return points of the rim of an outline that is turned to a heading, no farther apart than this, m."""
    assert robot.outline_m is not None
    corners = np.array(robot.outline_m) @ rotation(heading_rad).T
    after = np.roll(corners, -1, axis=0)
    edges = zip(corners, after, np.ceil(np.hypot(*(after - corners).T) / every_m).astype(int), strict=True)
    return np.concatenate([one + np.arange(n)[:, None] / n * (other - one) for one, other, n in edges])


def ahead_m(robot: RobotSpec, way: float) -> float:
    """Return how far the body reaches ahead of the middle of the axle, or behind it where the way is below 0, m."""
    if robot.outline_m is None:
        return robot.radius_m
    return float((np.copysign(1.0, way) * np.array(robot.outline_m)[:, 0]).max())
