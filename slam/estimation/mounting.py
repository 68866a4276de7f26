"""Between the body and the scanner on it: a back end follows the scanner, and everybody else is told of the body.

So that a scan is always seen from its own frame, wherever the scanner sits.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from ..geometry.poses import J, compose, inverse, rotation
from ..robot import Odometry, ScannerSpec
from .backend import Belief, Joint


def carried(
    pose_world: Float[np.ndarray, "3"], offset: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Return the pose of what is fixed at `offset` in the frame of a pose, and its derivative by that pose."""
    G = np.eye(3)
    G[:2, 2] = J @ rotation(pose_world[2]) @ offset[:2]
    return compose(pose_world, offset), G


def start_of_scanner(
    pose_world: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"], scanner: ScannerSpec
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Return where a back end begins, for a body that begins at a pose with a covariance."""
    if scanner.is_at_axle:
        return pose_world, cov
    pose, G = carried(pose_world, scanner.pose_robot)
    return pose, G @ cov @ G.T


def scanner_poses(poses_world: Float[np.ndarray, "n 3"], scanner: ScannerSpec) -> Float[np.ndarray, "n 3"]:
    """Return where the scanner of a body at each of some poses is."""
    if scanner.is_at_axle:
        return poses_world
    return np.array([compose(pose, scanner.pose_robot) for pose in poses_world]).reshape(poses_world.shape)


def body_poses(poses_world: Float[np.ndarray, "n 3"], scanner: ScannerSpec) -> Float[np.ndarray, "n 3"]:
    """Return where the body is whose scanner is at each of some poses."""
    if scanner.is_at_axle:
        return poses_world
    offset = inverse(scanner.pose_robot)
    return np.array([compose(pose, offset) for pose in poses_world]).reshape(poses_world.shape)


def odometry_of_scanner(odometry: Odometry, scanner: ScannerSpec) -> Odometry:
    """Return the motion of the scanner, in its own frame before it, for a motion of the body."""
    if scanner.is_at_axle:
        return odometry
    mount, turned = scanner.pose_robot, rotation(-scanner.heading_rad)
    A = np.eye(3)
    A[:2, :2] = turned
    A[:2, 2] = turned @ J @ rotation(odometry.motion[2]) @ mount[:2]
    motion = compose(inverse(mount), compose(odometry.motion, mount))
    # A turn of a motion is its own, not one brought into half a turn.
    motion[2] = odometry.motion[2]
    return replace(odometry, motion=motion, cov=A @ odometry.cov @ A.T)


def odometry_of_body(odometry: Odometry, scanner: ScannerSpec) -> Odometry:
    """Return the motion of the body for a motion of its scanner."""
    return odometry_of_scanner(odometry, ScannerSpec(*inverse(scanner.pose_robot).tolist()))


def belief_of_body(belief: Belief, scanner: ScannerSpec) -> Belief:
    """Return the belief about the body and the map, for one about the scanner and the map."""
    if scanner.is_at_axle:
        return belief
    offset = inverse(scanner.pose_robot)
    pose, G = carried(belief.pose_world, offset)

    def query(ids: Int[np.ndarray, " m"]) -> Joint:
        joint = belief.query(ids)
        mean, cov = joint.mean.copy(), joint.cov.copy()
        mean[:3], by_scanner = carried(joint.mean[:3], offset)
        cov[:3] = by_scanner @ cov[:3]
        cov[:, :3] = cov[:, :3] @ by_scanner.T
        return Joint(mean, cov, joint.anchors)

    return replace(belief, pose_world=pose, pose_cov=G @ belief.pose_cov @ G.T, query=query)
