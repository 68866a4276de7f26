"""Relocation, then fusion (Moutarlier and Chatila), with every cross-covariance kept, the noise's own included."""

import numpy as np
from jaxtyping import Float

from ..estimation.backend import POSE, Observations
from ..estimation.models import Linear, innovations, stack
from ..geometry.poses import wrap
from .kalman import kernels
from .kalman.dense_map import DenseMap, cholesky
from .kalman.ekf import Ekf


class RelocationMap(DenseMap):
    """A map whose pose and lines are corrected by different gains."""

    def relocated(self, first: Linear) -> Float[np.ndarray, "3"]:
        """Return the pose corrected by `first`; nothing moves yet."""
        PHt, S = self._predicted(first)
        pose = self.pose_world + PHt[:POSE] @ np.linalg.solve(S + first.R, first.e)
        pose[2] = wrap(pose[2])
        return pose

    def fuse(
        self, first: Linear, second: Linear, moved: Float[np.ndarray, "3"], shared: Float[np.ndarray, "k l"]
    ) -> None:
        """Put the pose where `first` has moved it, and the lines where `second` moves them.

        With A and B the gains of pose and lines, v and w the noises, the errors become dp - A (H_1 dx + v) and
        dl - B (H_2 dx + w); `shared` is the covariance of v with w.
        """
        PHt1, S1 = self._predicted(first)
        PHt2, S2 = self._predicted(second)
        across, pose_cov = kernels.across(self._P, np.arange(POSE)), self.pose_cov
        S1, both = S1 + first.R, first.H @ PHt2[self._columns(first.rows)] + shared
        A = np.linalg.solve(S1, PHt1[:POSE].T).T
        pose_cov -= A @ S1 @ A.T
        B = np.linalg.solve(S2 + second.R, PHt2.T).T
        across += (A @ both - PHt2[:POSE]) @ B.T - A @ PHt1.T
        self._correct(PHt2, cholesky(S2 + second.R), second.e)
        self._x[:POSE] = moved
        self._P[:, :POSE] = across.T
        self._P[:POSE, :POSE] = 0.5 * (pose_cov + pose_cov.T)


class RelocationEkf(Ekf[RelocationMap]):
    """Moves the robot alone by the first matches, then the map alone by the second, seen from where the robot is now.

    The noise of an observation that moved the robot is in the robot's error when the map is fused: both gains act on
    the errors there were before, so that no observation counts twice (docs/contributing/estimation-notes.md).
    """

    new_map = RelocationMap

    def update(self, first: Observations, second: Observations) -> None:
        """Relocate by `first`, then fuse `second`."""
        moving, fused = self.belief.rows(first.ids), self.belief.rows(second.ids)
        if not len(moving) + len(fused):
            return
        self._move_on()
        relocation = stack(moving, self.compare(moving, first, self.map.pose_world, self.map.means[moving]))
        pose, moved = self.map.pose_world, self.map.relocated(relocation)
        again = innovations(moved, self.map.anchors[fused], self.map.means[fused], second.lines, second.cov)
        step = moved - pose
        step[2] = wrap(step[2])
        fusion = stack(fused, again).before(step)
        self.map.fuse(relocation, fusion, moved, _shared_noise(first, second, relocation, fusion))


def _shared_noise(
    first: Observations, second: Observations, relocation: Linear, fusion: Linear
) -> Float[np.ndarray, "k l"]:
    """Return the covariance of the noises of both steps: an observation's own, whichever line it was matched to."""
    same = np.all(first.lines[:, None] == second.lines[None], axis=-1)
    sigmas = np.sqrt(np.outer(np.diag(relocation.R), np.diag(fusion.R)))
    return np.kron(same, np.eye(2)) * sigmas
