"""A frame of the map's own, for a map that begins in the blind: where it lies in the world is kept beside the map.

What a robot lost before it saw its first wall is the same for all it sees afterwards, and no scan can tell it. In the
state of an estimator it is the largest error of all, and each Jacobian taken elsewhere turns a little of it into
information that was never measured. Here it is a constant: sound to first order, whatever the estimator does.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from ...estimation.backend import Joint
from ...estimation.models import move
from ...robot import Odometry
from . import kernels as frame_kernels


@dataclass(frozen=True)
class Frame:
    """Where a map's frame lies in the world; independent of everything in the map."""

    pose_world: Float[np.ndarray, "3"]
    cov: Float[np.ndarray, "3 3"]

    def moved(self, odometry: Odometry) -> "Frame":
        """Return where the frame lies after a motion: a map that has not begun moves with the robot."""
        step = move(self.pose_world, odometry.motion)
        cov = step.F @ self.cov @ step.F.T + step.noise(odometry.cov)
        return Frame(step.pose_world, 0.5 * (cov + cov.T))

    def anchors_world(self, anchors: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "m 2"]:
        """Return anchors (m, 2) m of the map's frame in the world frame: constants still, since the frame is one."""
        return frame_kernels.anchors_world(self.pose_world, anchors)

    def means_world(self, means: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "m 2"]:
        """Return lines (alpha, d) about their anchors in the world frame; a line and its anchor move as one."""
        return frame_kernels.means_world(self.pose_world, means)

    def joint_world(self, joint: Joint) -> Joint:
        """Return the Gaussian of pose and lines in the world frame: the map's own error, and the frame's on top."""
        return Joint(*frame_kernels.joint_world(self.pose_world, self.root, joint.mean, joint.cov, joint.anchors))

    @cached_property
    def root(self) -> Float[np.ndarray, "3 3"]:
        """A root of the covariance, also where something of the frame is known exactly."""
        try:
            return np.linalg.cholesky(self.cov)
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(self.cov)
            return np.ascontiguousarray(vectors * np.sqrt(np.maximum(values, 0.0)))
