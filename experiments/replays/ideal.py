"""The ideal EKF, which evaluates every Jacobian at the truth: the limit of what better Jacobians could achieve.

It is the reference of the papers on observability (Huang, Mourikis and Roumeliotis). Since it reads the truth of the
drive, it is not in the registry of back ends, and can only replay.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.backends.kalman.dense_map import DenseMap
from chainslam.slam.backends.kalman.ekf import Ekf
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.estimation.models import Initialisation, Innovations, Motion, initialise, innovations, move
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import J, rotation
from chainslam.slam.robot import Odometry

from .observations import DriveObservations

NAME = "ideal-ekf"


class IdealEkf(Ekf[DenseMap]):
    """The full filter with its Jacobians at the true poses and the true directions of the walls of a drive."""

    new_map = DenseMap

    def __init__(
        self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"], drive: DriveObservations
    ) -> None:
        """Start before the first scan of a drive, with an empty map."""
        super().__init__(pose_world, pose_cov)
        self._drive, self._scan = drive, 0
        self._alpha = np.zeros(0)
        """True direction of each line, world frame."""

    def _begin_frame(self) -> None:
        """Stay in the world's frame, where the truth is: at true Jacobians nothing is learnt of where it lies."""

    @property
    def _position(self) -> Float[np.ndarray, "2"]:
        return self._drive.true_poses_world[self._scan, :2]

    def motion(self, odometry: Odometry) -> tuple[Motion, Float[np.ndarray, "3 3"]]:
        """Return the motion with the Jacobians of the true one."""
        before, F, W = self._drive.true_poses_world[self._scan], np.eye(3), np.eye(3)
        self._scan += 1
        F[:2, 2], W[:2, :2] = J @ (self._position - before[:2]), rotation(float(before[2]))
        motion = Motion(move(self.map.pose_world, odometry.motion).pose_world, F, W)
        return motion, motion.noise(odometry.cov)

    def compare(
        self,
        rows: Int[np.ndarray, " m"],
        seen: Observations,
        pose_world: Float[np.ndarray, "3"],
        means: Float[np.ndarray, "m 2"],
    ) -> Innovations:
        """Compare observations with what pose and lines predict, with the Jacobian at the truth."""
        here = innovations(pose_world, self.map.anchors[rows], means, seen.lines, seen.cov)
        pose = np.append(self._position, self._drive.true_poses_world[self._scan, 2])
        true = np.stack([self._alpha[rows], means[:, 1]], axis=-1)
        there = innovations(pose, self.map.anchors[rows], true, seen.lines, seen.cov)
        return replace(there, e=here.e, R=here.R)

    def first_sight(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> tuple[Initialisation, Float[np.ndarray, "m 2 2"]]:
        """Return new lines with the Jacobians of the true ones."""
        new, walls = initialise(self.map.pose_world, lines, centres), self._drive.first[self._scan].walls
        alpha = np.array([self._drive.true_lines_world[wall][0] for wall in walls.tolist()])
        n, lever = normals(alpha), np.vecdot(directions(alpha), self._position - new.anchors)
        new.G_pose[:, 1, :2], new.G_pose[:, 1, 2] = n, lever
        self._alpha = np.concatenate([self._alpha, alpha])
        return new, new.noise(cov)
