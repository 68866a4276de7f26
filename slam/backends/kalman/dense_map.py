"""A Gaussian of the pose and of lines that come and go, with every cross-covariance.

P is one Fortran-ordered square of which the lower triangle and the pose's block hold; BLAS updates it in place. A line
has a slot, two rows of P; a slot that is free holds zeros, so removing a line moves nothing and a new line takes its
place.
"""

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg.blas import dsymm, dsyr2k, dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from ...estimation.backend import POSE, Joint, columns_of
from ...estimation.models import Initialisation, Linear, Motion
from ...geometry.poses import wrap
from . import kernels

SPARE = 16
"""Slots are added by so many at least, and by an eighth of those there are."""


class DenseMap:
    """Pose and lines with their joint covariance, and the few operations that filters need."""

    def __init__(self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"]) -> None:
        self.ids = np.zeros(0, dtype=np.int64)
        self.anchors = np.zeros((0, 2))
        self._next_id = 0
        self._slots = np.zeros(0, dtype=np.int64)
        self._free: list[int] = []
        self._x, self._P = pose_world, pose_cov
        self._reserve(SPARE)  # Has both in arrays of its own.

    @property
    def pose_world(self) -> Float[np.ndarray, "3"]:
        """The estimated pose."""
        return self._x[:POSE].copy()

    @property
    def pose_cov(self) -> Float[np.ndarray, "3 3"]:
        """The pose's covariance."""
        return self._P[:POSE, :POSE].copy("C")

    @property
    def means(self) -> Float[np.ndarray, "n 2"]:
        """(alpha, d) of the lines, in the order of `ids`."""
        return self._x[POSE:].reshape(-1, 2)[self._slots]

    @property
    def variances(self) -> Float[np.ndarray, " s"]:
        """Those of the pose and of all lines, s = 3 + 2 n."""
        return np.diagonal(self._P)[self._columns(np.arange(len(self.ids)))]

    def joint(self, rows: Int[np.ndarray, " m"]) -> Joint:
        """Return the Gaussian of the pose and some lines."""
        columns = self._columns(rows)
        return Joint(self._x[columns], kernels.block(self._P, columns), self.anchors[rows])

    def move(self, motion: Motion, Q: Float[np.ndarray, "3 3"]) -> None:
        """Take the pose along a motion: its error becomes F times what it was, and noise of covariance Q."""
        block = motion.F @ self.pose_cov @ motion.F.T + Q
        self._P[POSE:, :POSE] = self._P[POSE:, :POSE] @ motion.F.T
        self._P[:POSE, :POSE] = 0.5 * (block + block.T)
        self._x[:POSE] = motion.pose_world

    def append(self, new: Initialisation, noise: Float[np.ndarray, "m 2 2"]) -> Int[np.ndarray, " m"]:
        """Add lines whose error is G_pose times the pose's, and noise; return their ids."""
        m = len(new.means)
        self._reserve(m)
        slots = np.array([self._free.pop() for _ in range(m)], dtype=np.int64)
        columns = (POSE + 2 * slots[:, None] + np.arange(2)).ravel()
        G = new.G_pose.reshape(2 * m, POSE)
        across = G @ kernels.across(self._P, np.arange(POSE))
        block = (across[:, :POSE] @ G.T).reshape(m, 2, m, 2)
        each = np.arange(m)
        block[each, :, each, :] += noise
        block = block.reshape(2 * m, 2 * m)
        across[:, columns] = 0.5 * (block + block.T)
        for j, values in zip(columns.tolist(), across, strict=True):
            self._P[j, :j], self._P[j:, j] = values[:j], values[j:]
        self._x[columns] = new.means.ravel()
        ids = np.arange(self._next_id, self._next_id + m)
        self._next_id += m
        self.ids, self._slots = np.concatenate([self.ids, ids]), np.concatenate([self._slots, slots])
        self.anchors = np.concatenate([self.anchors, new.anchors])
        return ids

    def drop(self, rows: Int[np.ndarray, " m"]) -> None:
        """Forget lines."""
        rows = np.unique(rows)
        for j in self._columns(rows)[POSE:].tolist():
            self._P[j, :j], self._P[j:, j], self._x[j] = 0.0, 0.0, 0.0
        self._free += self._slots[rows].tolist()
        self.ids, self._slots = np.delete(self.ids, rows), np.delete(self._slots, rows)
        self.anchors = np.delete(self.anchors, rows, axis=0)

    def condition(self, model: Linear) -> None:
        """Take in a measurement: x += P H' S^-1 e, P -= P H' S^-1 H P."""
        PHt, S = self._predicted(model)
        self._correct(PHt, cholesky(S + model.R), model.e)

    def shear(self, by_pose: Float[np.ndarray, "3 3"], by_line: Float[np.ndarray, "n 2 3"]) -> None:
        """Add multiples of the pose's error to all errors: P <- D P D' with D = I + [by_pose; by_line] [I3, 0]."""
        U = np.zeros((len(self._x), POSE), order="F")
        U[:POSE] = by_pose
        U[self._columns(np.arange(len(self.ids)))[POSE:]] = by_line.reshape(-1, POSE)
        B = kernels.across(self._P, np.arange(POSE)).T + 0.5 * U @ self.pose_cov
        self._P = dsyr2k(1.0, U, B, beta=1.0, c=self._P, lower=1, overwrite_c=1)
        self._mirror_pose()

    def follow(self, moves: Float[np.ndarray, "s 3"], common: Float[np.ndarray, "s 3"]) -> None:
        """Add multiples of what all errors have in common to all errors: P <- D P D' with D = I + moves common'.

        Rows are those of the pose and of all lines, s = 3 + 2 n.
        """
        columns, t = self._columns(np.arange(len(self.ids))), len(self._x)
        U, V = np.zeros((t, POSE), order="F"), np.zeros((t, POSE), order="F")
        U[columns], V[columns] = moves, common
        PV = dsymm(1.0, self._P, V, lower=1)
        self._P = dsyr2k(1.0, U, PV + 0.5 * U @ (V.T @ PV), beta=1.0, c=self._P, lower=1, overwrite_c=1)
        self._mirror_pose()

    def _columns(self, rows: Int[np.ndarray, " m"]) -> Int[np.ndarray, " s"]:
        """Return where the pose and some lines stand in x and P."""
        return columns_of(self._slots[rows])

    def _correct(
        self, PHt: Float[np.ndarray, "t k"], root: Float[np.ndarray, "k k"], e: Float[np.ndarray, " k"]
    ) -> None:
        """Apply the gain P H' S^-1, S = root root'; overwrites PHt."""
        if not len(e):
            return
        W = dtrsm(1.0, root, PHt, side=1, lower=1, trans_a=1, overwrite_b=1)
        self._x += W @ dtrsv(root, e, lower=1)
        self._P = dsyrk(-1.0, W, beta=1.0, c=self._P, lower=1, overwrite_c=1)
        self._mirror_pose()
        self._x[2] = wrap(self._x[2])
        self._x[POSE::2] = wrap(self._x[POSE::2])

    def _predicted(self, model: Linear) -> tuple[Float[np.ndarray, "t k"], Float[np.ndarray, "k k"]]:
        """Return P H' and H P H'."""
        columns = self._columns(model.rows)
        PHt = (model.H @ kernels.across(self._P, columns)).T
        return PHt, model.H @ PHt[columns]

    def _mirror_pose(self) -> None:
        self._P[0, 1:POSE], self._P[1, 2] = self._P[1:POSE, 0], self._P[2, 1]

    def _reserve(self, lines: int) -> None:
        """Have room for so many lines more."""
        if len(self._free) >= lines:
            return
        old = len(self._x)
        slots = (old - POSE) // 2
        more = max(lines - len(self._free), SPARE, slots // 8)
        x, P = np.zeros(old + 2 * more), np.zeros((old + 2 * more, old + 2 * more), order="F")
        x[:old], P[:old, :old] = self._x, self._P
        self._x, self._P = x, P
        self._free = list(range(slots + more - 1, slots - 1, -1)) + self._free


def cholesky(S: Float[np.ndarray, "k k"]) -> Float[np.ndarray, "k k"]:
    """Return the lower root of S; raises numpy.linalg.LinAlgError where S is not positive definite."""
    if not len(S):
        return S
    root, failed = dpotrf(S, lower=1)
    if failed:
        raise np.linalg.LinAlgError("expected a positive definite innovation covariance: are all noises above zero?")
    return root
