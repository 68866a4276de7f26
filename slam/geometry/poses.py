"""Angles and poses (x m, y m, heading rad) of the plane."""

from typing import Any

import numpy as np
from jaxtyping import Float

J = np.array([[0.0, -1.0], [1.0, 0.0]])
"""Turns a vector by +90 degrees."""


def wrap(angle: Any) -> Any:
    """Return angles rad brought into [-pi, pi)."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def wrap_positive(angle: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """Return angles rad brought into [0, 2 pi), in their own precision: what np.mod does in a third of its time."""
    turn = angle.dtype.type(2 * np.pi)
    rest = np.fmod(angle, turn)
    return rest + turn * (rest < 0)


def rotation(angle: float) -> Float[np.ndarray, "2 2"]:
    """Return the matrix that turns vectors by `angle` rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def turned(points: Float[np.ndarray, "n *k 2"], angles: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n *k 2"]:
    """Return n points, or n groups of points, each turned about the origin by its own angle rad."""
    c, s = (f(angles).reshape(-1, *[1] * (points.ndim - 2)) for f in (np.cos, np.sin))
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def compose(pose_world: Float[np.ndarray, "3"], motion: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Return the pose reached from `pose_world` by `motion`, which is given in that pose's frame."""
    position = pose_world[:2] + rotation(pose_world[2]) @ motion[:2]
    return np.array([position[0], position[1], wrap(pose_world[2] + motion[2])])


def inverse(pose: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Return the old frame as seen from the pose, so that the two compose to nothing."""
    position = -rotation(-pose[2]) @ pose[:2]
    return np.array([position[0], position[1], wrap(-pose[2])])


def to_world(points_robot: Float[np.ndarray, "*n 2"], pose_world: Float[np.ndarray, "3"]) -> Float[np.ndarray, "*n 2"]:
    """Return points given in the robot frame in the world frame."""
    return points_robot @ rotation(pose_world[2]).T + pose_world[:2]


def to_robot(points_world: Float[np.ndarray, "*n 2"], pose_world: Float[np.ndarray, "3"]) -> Float[np.ndarray, "*n 2"]:
    """Return points given in the world frame in the robot frame."""
    return (points_world - pose_world[:2]) @ rotation(pose_world[2])


def arc(forward_m: float, turn_rad: float) -> Float[np.ndarray, "3"]:
    """Return the motion (x, y, heading) along an arc of constant curvature, in the frame of its start."""
    half = 0.5 * turn_rad
    chord = forward_m * np.sinc(half / np.pi)
    return np.array([chord * np.cos(half), chord * np.sin(half), turn_rad])


def body_pair_covs(
    first: Float[np.ndarray, "m 3"], second: Float[np.ndarray, "m 3"], covs: Float[np.ndarray, "m 6 6"]
) -> Float[np.ndarray, "m 6 6"]:
    """Return covariances of two poses' errors together, world frame, with each pose's error in its own frame."""
    turn = np.zeros((len(covs), 6, 6))
    for at, poses in ((0, first), (3, second)):
        c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        turn[:, at, at], turn[:, at, at + 1], turn[:, at + 1, at], turn[:, at + 1, at + 1] = c, s, -s, c
        turn[:, at + 2, at + 2] = 1.0
    return np.asarray(turn @ covs @ turn.swapaxes(1, 2))
