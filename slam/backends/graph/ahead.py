"""A pose carried ahead by the odometry: what a factor graph expects before the next scan is in it."""

import numpy as np
from jaxtyping import Float

from ...estimation.models import move
from ...geometry.poses import rotation


class Ahead:
    """A pose some predictions ahead of a pose of the graph."""

    def __init__(self, pose: Float[np.ndarray, "3"]) -> None:
        self.pose = pose
        self._F, self._Q = np.eye(3), np.zeros((3, 3))
        self._F[:2, :2] = rotation(pose[2])

    def move(self, motion: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> None:
        """Carry the pose ahead by one more motion."""
        step = move(self.pose, motion)
        self.pose = step.pose_world
        self._F = step.F @ self._F
        self._Q = step.F @ self._Q @ step.F.T + step.W @ cov @ step.W.T

    def pose_cov(self, cov_body: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
        """Return the covariance ahead, given that of the graph's pose in its body frame."""
        cov = self._F @ cov_body @ self._F.T + self._Q
        return np.asarray(0.5 * (cov + cov.T))

    def joint_cov(self, cov: Float[np.ndarray, "s s"]) -> Float[np.ndarray, "s s"]:
        """Return the joint covariance of the pose ahead and the lines, in which the pose's own block is not carried."""
        cov[:3, 3:] = self._F @ cov[:3, 3:]
        cov[3:, :3] = cov[:3, 3:].T
        return cov
