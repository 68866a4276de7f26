"""A frame of the map's own, for a map that begins in the blind: where it lies in the world is kept beside the map.

What a robot lost before it saw its first wall is the same for all it sees afterwards, and no scan can tell it. In the
state of an estimator it is the largest error of all, and each Jacobian taken elsewhere turns a little of it into
information that was never measured. Here it is a constant: sound to first order, whatever the estimator does.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from ..estimation.backend import Joint
from ..estimation.models import move
from ..geometry.lines import directions, normals
from ..geometry.poses import J, compose, rotation, wrap
from ..robot import Odometry


@dataclass(frozen=True)
class Frame:
    """Where a map's frame lies in the world; independent of everything in the map."""

    pose_world: Float[np.ndarray, "3"]
    cov: Float[np.ndarray, "3 3"]

    def moved(self, odometry: Odometry) -> "Frame":
        """Return where the frame lies after a motion: a map that has not begun moves with the robot."""
        step = move(self.pose_world, odometry.motion)
        cov = step.F @ self.cov @ step.F.T + step.W @ odometry.cov @ step.W.T
        return Frame(step.pose_world, 0.5 * (cov + cov.T))

    def anchors_world(self, anchors: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "m 2"]:
        """Return anchors (m, 2) m of the map's frame in the world frame: constants still, since the frame is one."""
        c, s = np.cos(self.pose_world[2]), np.sin(self.pose_world[2])
        turned = np.stack([c * anchors[:, 0] - s * anchors[:, 1], s * anchors[:, 0] + c * anchors[:, 1]], axis=-1)
        return np.asarray(turned + self.pose_world[:2])

    def means_world(self, means: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "m 2"]:
        """Return lines (alpha, d) about their anchors in the world frame; a line and its anchor move as one."""
        return np.stack([wrap(means[:, 0] + self.pose_world[2]), means[:, 1]], axis=-1)

    def joint_world(self, joint: Joint) -> Joint:
        """Return the Gaussian of pose and lines in the world frame: the map's own error, and the frame's on top."""
        pose = compose(self.pose_world, joint.mean[:3])
        means, anchors = self.means_world(joint.mean[3:].reshape(-1, 2)), self.anchors_world(joint.anchors)
        cov, by_frame = self._turned(joint.cov), self.moving(pose, means, anchors)
        # Column by column, so that each entry is the same whatever else is asked for.
        for column in self.root.T:
            moves = by_frame[:, 0] * column[0] + by_frame[:, 1] * column[1] + by_frame[:, 2] * column[2]
            cov += moves[:, None] * moves
        return Joint(np.concatenate([pose, means.ravel()]), cov, anchors)

    def moving(
        self,
        pose_world: Float[np.ndarray, "3"],
        means_world: Float[np.ndarray, "m 2"],
        anchors_world: Float[np.ndarray, "m 2"],
    ) -> Float[np.ndarray, "s 3"]:
        """Return how a pose and lines about their anchors move with the frame, s = 3 + 2 m.

        With (s, phi) the error of the frame, everything moves as one: dp = s + J (p - o) phi, d_alpha = phi,
        dd = n·(s + J (c - o) phi), o the frame's origin.
        """
        origin = self.pose_world[:2]
        by_frame = np.zeros((3 + 2 * len(means_world), 3))
        by_frame[0, 0] = by_frame[1, 1] = 1.0
        by_frame[:2, 2], by_frame[2, 2] = J @ (pose_world[:2] - origin), 1.0
        if len(means_world):
            by_frame[3::2, 2] = 1.0
            by_frame[4::2, :2] = normals(means_world[:, 0])
            by_frame[4::2, 2] = -np.vecdot(directions(means_world[:, 0]), anchors_world - origin)
        return by_frame

    @cached_property
    def root(self) -> Float[np.ndarray, "3 3"]:
        """A root of the covariance, also where something of the frame is known exactly."""
        try:
            return np.linalg.cholesky(self.cov)
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(self.cov)
            return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))

    def _turned(self, cov: Float[np.ndarray, "s s"]) -> Float[np.ndarray, "s s"]:
        """Return a covariance with the position's error turned into the world frame."""
        c, s = np.cos(self.pose_world[2]), np.sin(self.pose_world[2])
        turned = cov.copy()
        turned[0], turned[1] = c * cov[0] - s * cov[1], s * cov[0] + c * cov[1]
        block = rotation(self.pose_world[2]) @ cov[:2, :2] @ rotation(self.pose_world[2]).T
        turned[:2, :2] = 0.5 * (block + block.T)
        turned[2:, :2] = turned[:2, 2:].T
        return turned
