"""Errors of poses in space, of six axes, translation first, and paths brought into one frame.

A pose is x y z qx qy qz qw. X = (R, p) is the true one and X^ the estimated one, as elements of SE(3):

- additive: (p - p^, log(R R^^T)), both along the axes of the world. To first order the second part is the turn about
  the fixed axes x, y and z that ROS calls roll, pitch and yaw; it is no difference of Euler angles;
- body: log(X^^-1 X), right error, along the axes of the estimated body;
- world: log(X X^^-1), left error: a turn about the origin of the world and a shift.
"""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from ....usage import UsageError
from .plane import Frame

Poses = Float[np.ndarray, "n 7"]
Covs = Float[np.ndarray, "n 6 6"]
SMALL_RAD = 1e-3
"""Below it the series of the logarithm is exact to the last digit."""
FLAT = 1e-6
"""A path whose second widest extent is less than this part of the widest is a line."""


def errors(estimated: Poses, true: Poses, frame: Frame) -> Float[np.ndarray, "n 6"]:
    """Return the errors (n, 6), m m m rad rad rad, of poses in the world frame."""
    if frame == "body":
        return logarithm(between(estimated, true))
    turns = turns_of(true) * turns_of(estimated).inv()
    if frame == "world":
        shifts = true[:, :3] - turns.apply(estimated[:, :3])
        return logarithm(_poses(shifts, turns))
    return np.column_stack([true[:, :3] - estimated[:, :3], turns.as_rotvec()])


def coordinates(motions: Poses) -> Float[np.ndarray, "n 6"]:
    """Return shift and rotation vector of motions."""
    return np.column_stack([motions[:, :3], turns_of(motions).as_rotvec()])


def motions_of(coordinates: Float[np.ndarray, "n 6"]) -> Poses:
    """Return the motions of shifts and rotation vectors."""
    return _poses(coordinates[:, :3], Rotation.from_rotvec(coordinates[:, 3:]))


def slopes(motions: Poses) -> Covs:
    """Return the derivatives of the coordinates of motions by a small motion after each."""
    found, turns = np.zeros((len(motions), 6, 6)), turns_of(motions)
    found[:, :3, :3] = turns.as_matrix()
    K = cross(turns.as_rotvec())
    found[:, 3:, 3:] = np.eye(3) + 0.5 * K + _second(np.asarray(turns.magnitude()))[:, None, None] * (K @ K)
    return found


def adjoint_of_inverse(motions: Poses) -> Covs:
    """Return Ad(M^-1) of each motion M: a small motion made before M, as it would be made after M."""
    found, back = np.zeros((len(motions), 6, 6)), turns_of(motions).inv().as_matrix()
    found[:, :3, :3] = found[:, 3:, 3:] = back
    found[:, :3, 3:] = -back @ cross(motions[:, :3])
    return found


def composed(first: Poses, second: Poses) -> Poses:
    """Return each motion of `first` with the one of `second` after it."""
    turns = turns_of(first)
    return _poses(first[:, :3] + turns.apply(second[:, :3]), turns * turns_of(second))


def to_frame(estimated: Poses, covs: Covs, given: Frame, wanted: Frame) -> Covs:
    """Return covariances of errors in one frame as those in another, to first order."""
    if given == wanted:
        return covs
    changes = np.linalg.inv(_from_additive(estimated, given)) if given != "additive" else np.eye(6)
    if wanted != "additive":
        changes = _from_additive(estimated, wanted) @ changes
    return np.asarray(changes @ covs @ np.swapaxes(changes, -1, -2))


def _from_additive(estimated: Poses, frame: Frame) -> Float[np.ndarray, "n 6 6"]:
    """Return the derivatives of errors in the body or the world frame by additive ones."""
    changes = np.tile(np.eye(6), (len(estimated), 1, 1))
    if frame == "world":
        changes[:, :3, 3:] = cross(estimated[:, :3])
    else:
        changes[:, :3, :3] = changes[:, 3:, 3:] = turns_of(estimated).inv().as_matrix()
    return changes


def moved(poses: Poses, motion: Float[np.ndarray, "7"]) -> Poses:
    """Return poses after a rigid motion of the world."""
    turn = Rotation.from_quat(motion[3:])
    return _poses(turn.apply(poses[:, :3]) + motion[:3], turn * turns_of(poses))


def moved_covs(covs: Covs, motion: Float[np.ndarray, "7"], frame: Frame) -> Covs:
    """Return covariances after a rigid motion of the world."""
    if frame == "body":
        return covs
    change, turn = np.zeros((6, 6)), Rotation.from_quat(motion[3:]).as_matrix()
    change[:3, :3] = change[3:, 3:] = turn
    if frame == "world":
        change[:3, 3:] = cross(motion[None, :3])[0] @ turn
    return np.asarray(change @ covs @ change.T)


def motion_at_start(estimated: Poses, true: Poses) -> Float[np.ndarray, "7"]:
    """Return the rigid motion of the world that brings the first estimated pose to the true one."""
    turn = turns_of(true[:1]) * turns_of(estimated[:1]).inv()
    return _poses(true[:1, :3] - turn.apply(estimated[:1, :3]), turn)[0]


def alignment_of_paths(estimated: Poses, true: Poses) -> Float[np.ndarray, "7"]:
    """Return the rigid motion that brings the estimated positions nearest to the true ones; raises UsageError.

    The method of Umeyama (1991), without scale. Of a path along a line the turn about it is unknown.
    """
    from_centre, to_centre = estimated[:, :3].mean(axis=0), true[:, :3].mean(axis=0)
    U, extents, V = np.linalg.svd((true[:, :3] - to_centre).T @ (estimated[:, :3] - from_centre))
    if not extents[1] > FLAT * extents[0]:
        raise UsageError("expected a path that is no straight line for --align all in space, found one: use start")
    U[:, 2] *= np.linalg.det(U @ V)
    turn = Rotation.from_matrix(U @ V)
    return np.append(to_centre - turn.apply(from_centre), turn.as_quat())


def about(poses: Poses, place: Float[np.ndarray, "7"]) -> Poses:
    """Return poses with the origin of the world moved to the position of one."""
    return np.column_stack([poses[:, :3] - place[:3], poses[:, 3:]])


def between(first: Poses, second: Poses) -> Poses:
    """Return each second pose in the frame of the first one beside it."""
    back = turns_of(first).inv()
    return _poses(back.apply(second[:, :3] - first[:, :3]), back * turns_of(second))


def relation_covs(motions: Poses, pair_covs: Float[np.ndarray, "m 12 12"]) -> Covs:
    """Return the covariance of relations, given those of both poses' errors together, each in its body frame."""
    G = np.concatenate([-adjoint_of_inverse(motions), np.broadcast_to(np.eye(6), (len(motions), 6, 6))], axis=-1)
    return np.asarray(G @ pair_covs @ G.swapaxes(1, 2))


def interpolated(
    time_s: Float[np.ndarray, " s"], poses: Float[np.ndarray, "s 7"], asked_s: Float[np.ndarray, " m"]
) -> Float[np.ndarray, "m 7"]:
    """Return poses between those of a path, at even speed and turn; at its ends where the time lies beyond."""
    after = np.clip(np.searchsorted(time_s, asked_s), 1, max(len(time_s) - 1, 1)) % len(time_s)
    before = np.maximum(after - 1, 0)
    gaps = time_s[after] - time_s[before]
    share = np.divide(asked_s - time_s[before], gaps, out=np.zeros(len(asked_s)), where=gaps > 0.0).clip(0.0, 1.0)
    first, second = poses[before], poses[after]
    turn = Rotation.from_rotvec(share[:, None] * (turns_of(first).inv() * turns_of(second)).as_rotvec())
    return _poses(first[:, :3] + share[:, None] * (second - first)[:, :3], turns_of(first) * turn)


def logarithm(poses: Poses) -> Float[np.ndarray, "n 6"]:
    """Return log of each pose in SE(3), translation first."""
    turns = turns_of(poses).as_rotvec()
    K = cross(turns)
    back = np.eye(3) - 0.5 * K + _second(np.linalg.norm(turns, axis=1))[:, None, None] * (K @ K)
    return np.column_stack([(back @ poses[:, :3, None])[..., 0], turns])


def _second(angle: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the coefficient of the second order in the inverse of the Jacobians of the exponential of rotations."""
    half = 0.5 * np.maximum(angle, SMALL_RAD)
    exact = (1.0 - half / np.tan(half)) / (4.0 * half**2)
    return np.where(angle > SMALL_RAD, exact, 1.0 / 12.0 + angle**2 / 720.0)


def turns_of(poses: Poses) -> Rotation:
    """Return the rotations of poses."""
    return Rotation.from_quat(poses[:, 3:])


def cross(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return the matrices of the cross product with vectors."""
    found = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    found[:, 0, 1], found[:, 0, 2], found[:, 1, 2] = -z, y, -x
    return found - found.swapaxes(1, 2)


def _poses(positions: Float[np.ndarray, "n 3"], turns: Rotation) -> Poses:
    return np.column_stack([positions, turns.as_quat()])
