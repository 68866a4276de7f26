"""The error of a pose, in the frame in which its covariance is stated, and paths brought into one frame.

X is the true pose and X^ the estimated one, as elements of SE(2):

- additive: (x - x^, y - y^, wrapped theta - theta^), positions along the axes of the world;
- body: log(X^^-1 X), right error, along the axes of the estimated body;
- world: log(X X^^-1), left error: a turn about the origin of the world and a shift.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float

from chainslam.slam.evaluation.consistency import pose_covariances, pose_errors
from chainslam.slam.geometry.poses import J, rotation, turned, wrap

from ....scoring.trajectories import alignment_of_paths, moved
from ....scoring.without_truth.relation_noise import adjoint_of_inverse, body_covs, composed, relation_covs
from ....scoring.without_truth.relations import between, interpolated

Frame = Literal["additive", "body", "world"]

__all__ = [
    "NUMBERS", "Frame", "about", "adjoint_of_inverse", "alignment_of_paths", "between", "composed", "coordinates",
    "errors", "interpolated", "motion_at_start", "motions_of", "moved", "moved_covs", "relation_covs",
    "slopes", "to_frame",
]  # fmt: skip
NUMBERS = 3
"""Of a pose: x m, y m, heading rad."""
Poses = Float[np.ndarray, "n 3"]
Covs = Float[np.ndarray, "n 3 3"]


def errors(estimated: Poses, true: Poses, frame: Frame) -> Poses:
    """Return the errors (n, 3), m m rad, of poses in the world frame."""
    if frame == "world":
        return pose_errors(true, estimated)
    if frame == "body":
        return pose_errors(between(estimated, true), np.zeros_like(true))
    off = true - estimated
    return np.column_stack([off[:, :2], wrap(off[:, 2])])


def to_frame(estimated: Poses, covs: Covs, given: Frame, wanted: Frame) -> Covs:
    """Return covariances of errors in one frame as those in another, to first order."""
    if given == wanted:
        return covs
    plain = covs
    if given == "body":
        plain = body_covs(np.column_stack([estimated[:, :2], -estimated[:, 2]]), covs)
    elif given == "world":
        back = np.tile(np.eye(3), (len(covs), 1, 1))
        back[:, :2, 2] = estimated[:, :2] @ J.T
        plain = back @ covs @ back.swapaxes(1, 2)
    if wanted == "world":
        return pose_covariances(estimated, plain)
    return body_covs(estimated, plain) if wanted == "body" else np.asarray(plain)


def moved_covs(covs: Covs, motion: Float[np.ndarray, "3"], frame: Frame) -> Covs:
    """Return covariances after a rigid motion of the world."""
    if frame == "body":
        return covs
    change = np.eye(3)
    change[:2, :2] = rotation(float(motion[2]))
    if frame == "world":
        change[:2, 2] = -J @ motion[:2]
    return np.asarray(change @ covs @ change.T)


def motion_at_start(estimated: Poses, true: Poses) -> Float[np.ndarray, "3"]:
    """Return the rigid motion of the world that brings the first estimated pose to the true one."""
    turn = float(wrap(true[0, 2] - estimated[0, 2]))
    return np.append(true[0, :2] - rotation(turn) @ estimated[0, :2], turn)


def about(poses: Poses, place: Float[np.ndarray, "3"]) -> Poses:
    """Return poses with the origin of the world moved to the position of one."""
    return np.column_stack([poses[:, :2] - place[:2], poses[:, 2]])


def coordinates(motions: Poses) -> Poses:
    """Return shift and turn of motions: these themselves."""
    return motions


def motions_of(coordinates: Poses) -> Poses:
    """Return the motions of shifts and turns: these themselves."""
    return coordinates


def slopes(motions: Poses) -> Covs:
    """Return the derivatives of the coordinates of motions by a small motion after each."""
    found = np.tile(np.eye(3), (len(motions), 1, 1))
    found[:, :2, 0], found[:, :2, 1] = (turned(np.tile(axis, (len(motions), 1)), motions[:, 2]) for axis in np.eye(2))
    return found
