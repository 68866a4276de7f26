"""A pose carried ahead by the odometry: what a factor graph expects before the next scan is in it."""

import numpy as np
from jaxtyping import Float

from ...geometry.poses import rotation
from .kernels import carry, pose_cov_ahead


class Ahead:
    """A pose some predictions ahead of a pose of the graph."""

    def __init__(self, pose: Float[np.ndarray, "3"]) -> None:
        self.pose = pose
        self.F = np.eye(3)
        """Turns an error of the graph's pose, body frame, into one of the pose ahead."""
        self.F[:2, :2] = rotation(pose[2])
        self._Q = np.zeros((3, 3))

    def move(self, motion: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> None:
        """Carry the pose ahead by one more motion."""
        self.pose, self.F, self._Q = carry(self.pose, self.F, self._Q, motion, cov)

    def pose_cov(self, cov_body: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
        """Return the covariance ahead, given that of the graph's pose in its body frame."""
        return pose_cov_ahead(self.F, self._Q, cov_body)
