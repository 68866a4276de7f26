"""A pose carried ahead by the odometry: what a factor graph expects before the next scan is in it."""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from ...estimation.models import move
from ...geometry.lines import directions
from ...geometry.poses import rotation
from ...robot import Odometry


class Ahead:
    """A pose some motions ahead of a pose of the graph: its error is F times that one's, and noise of covariance Q."""

    def __init__(self, pose: Float[np.ndarray, "3"], motions: Iterable[Odometry]) -> None:
        self.pose = pose
        self.F, self.Q = np.eye(3), np.zeros((3, 3))
        self.F[:2, :2] = rotation(pose[2])  # The graph's pose errs in its body frame.
        for odometry in motions:
            step = move(self.pose, odometry.motion)
            self.pose, self.F = step.pose_world, step.F @ self.F
            self.Q = step.F @ self.Q @ step.F.T + step.noise(odometry.cov)

    def cov(
        self,
        joint_cov: Float[np.ndarray, "s s"],
        lines: Float[np.ndarray, "m 2"],
        anchors: Float[np.ndarray, "m 2"],
    ) -> Float[np.ndarray, "s s"]:
        """Return the covariance of the pose ahead and of lines (alpha, d) about anchors, s = 3 + 2 m.

        `joint_cov` is that of the graph's pose, body frame, and of the lines (alpha, r).
        """
        T, at = np.eye(len(joint_cov)), 3 + 2 * np.arange(len(lines))
        T[:3, :3] = self.F
        T[at + 1, at] = -np.vecdot(directions(lines[:, 0]), anchors)  # dd = dr - (t·c) dalpha.
        cov = T @ joint_cov @ T.T
        cov[:3, :3] += self.Q
        return np.asarray(0.5 * (cov + cov.T))
