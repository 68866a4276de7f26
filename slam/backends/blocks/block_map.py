"""A Gaussian of the pose and of lines of which only the diagonal blocks are kept: the paper's simplification."""

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import POSE, Joint
from ...estimation.models import Initialisation, Linear, Motion
from ...geometry.poses import wrap


class BlockMap:
    """Pose and lines, each with its own covariance and none with another's."""

    def __init__(self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"]) -> None:
        self.pose_world = np.array(pose_world, dtype=np.float64)
        self.pose_cov = np.array(pose_cov, dtype=np.float64)
        self.ids = np.zeros(0, dtype=np.int64)
        self.anchors = np.zeros((0, 2))
        self.means = np.zeros((0, 2))
        self.covs = np.zeros((0, 2, 2))
        self._next_id = 0

    def joint(self, rows: Int[np.ndarray, " m"]) -> Joint:
        """Return the Gaussian of the pose and some lines: zeros off the blocks."""
        m = len(rows)
        cov, lines, each = np.zeros((POSE + 2 * m, POSE + 2 * m)), np.zeros((m, 2, m, 2)), np.arange(m)
        lines[each, :, each, :] = self.covs[rows]
        cov[:POSE, :POSE], cov[POSE:, POSE:] = self.pose_cov, lines.reshape(2 * m, 2 * m)
        return Joint(np.concatenate([self.pose_world, self.means[rows].ravel()]), cov, self.anchors[rows])

    def move(self, motion: Motion, Q: Float[np.ndarray, "3 3"]) -> None:
        """Take the pose along a motion: its error becomes F times what it was, and noise of covariance Q."""
        self.pose_world = motion.pose_world
        self.pose_cov = _symmetric(motion.F @ self.pose_cov @ motion.F.T + Q)

    def append(self, new: Initialisation, noise: Float[np.ndarray, "m 2 2"]) -> Int[np.ndarray, " m"]:
        """Add lines whose error is G_pose times the pose's, and noise, and forget that it is the pose's."""
        covs = _symmetric(new.G_pose @ self.pose_cov @ new.G_pose.swapaxes(1, 2) + noise)
        ids = np.arange(self._next_id, self._next_id + len(covs))
        self._next_id += len(covs)
        self.ids = np.concatenate([self.ids, ids])
        self.anchors = np.concatenate([self.anchors, new.anchors])
        self.means, self.covs = np.concatenate([self.means, new.means]), np.concatenate([self.covs, covs])
        return ids

    def drop(self, rows: Int[np.ndarray, " m"]) -> None:
        """Forget lines."""
        self.ids, self.anchors = np.delete(self.ids, rows), np.delete(self.anchors, rows, axis=0)
        self.means, self.covs = np.delete(self.means, rows, axis=0), np.delete(self.covs, rows, axis=0)

    def condition(self, model: Linear) -> None:
        """Take in a measurement by the pose and the lines together, then drop what it made them share."""
        prior = self.joint(model.rows)
        PHt = prior.cov @ model.H.T
        gain = np.linalg.solve(_symmetric(model.H @ PHt + model.R), PHt.T).T
        mean, cov = prior.mean + gain @ model.e, _symmetric(prior.cov - gain @ PHt.T)
        self._put_pose(mean[:POSE], cov[:POSE, :POSE])
        u, each = len(model.rows), np.arange(len(model.rows))
        self.put(model.rows, mean[POSE:].reshape(u, 2), cov[POSE:, POSE:].reshape(u, 2, u, 2)[each, :, each, :])

    def relocate(self, model: Linear) -> None:
        """Take in a measurement by the pose alone, the lines held."""
        prior = self.joint(model.rows)
        PHt = prior.cov @ model.H.T
        S = _symmetric(model.H @ PHt + model.R)
        gain = np.linalg.solve(S, PHt[:POSE].T).T
        self._put_pose(self.pose_world + gain @ model.e, self.pose_cov - gain @ S @ gain.T)

    def put(
        self, rows: Int[np.ndarray, " m"], means: Float[np.ndarray, "m 2"], covs: Float[np.ndarray, "m 2 2"]
    ) -> None:
        """Replace lines."""
        means[:, 0] = wrap(means[:, 0])
        self.means, self.covs = self.means.copy(), self.covs.copy()
        self.means[rows], self.covs[rows] = means, _symmetric(covs)

    def _put_pose(self, pose_world: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> None:
        pose_world[2] = wrap(pose_world[2])
        self.pose_world, self.pose_cov = pose_world, _symmetric(cov)


def _symmetric(cov: Float[np.ndarray, "*n d d"]) -> Float[np.ndarray, "*n d d"]:
    return np.asarray(0.5 * (cov + cov.swapaxes(-1, -2)))
