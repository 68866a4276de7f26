"""The stochastic map in its rigorous form: an extended Kalman filter that keeps every cross-covariance."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from scipy.linalg import solve_triangular

from ..backend import Belief, Joint, Observations, StaleBeliefError
from ..geometry.poses import wrap
from ..models import grow, innovations, move, reanchor
from ..robot import Odometry

POSE = 3


class FullEkf:
    """EKF over (x, y, heading, alpha_1, d_1, ...); a joint update takes each observation once (Smith et al.)."""

    def __init__(
        self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"], *, at_wall: bool = True
    ) -> None:
        """Start at a pose with its covariance and an empty map.

        With `at_wall` lines are anchored where they were seen; without, at the world's origin (the paper's form).
        """
        self._at_wall = at_wall
        self._x = np.zeros(POSE + 2 * 16)
        self._P = np.zeros((len(self._x), len(self._x)))
        self._x[:POSE], self._P[:POSE, :POSE] = pose_world, pose_cov
        self._ids = np.zeros(0, dtype=np.int64)
        self._anchors = np.zeros((0, 2))
        self._next_id = 0
        self._version = 0

    @property
    def belief(self) -> Belief:
        """The estimate now."""
        version = self._version
        ids, anchors = self._ids, self._anchors
        x, P = self._x[: self._size].copy(), self._P

        def query(wanted: Int[np.ndarray, " m"]) -> Joint:
            if version != self._version:
                raise StaleBeliefError("expected a belief of the present step, found one whose back end has moved on")
            rows = belief.rows(wanted)
            index = self._columns(rows)
            return Joint(x[index], P[np.ix_(index, index)], anchors[rows])

        belief = Belief(x[:POSE], P[:POSE, :POSE].copy(), ids, anchors, x[POSE:].reshape(-1, 2), query)
        return belief

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by what the wheels report."""
        self._version += 1
        s = self._size
        motion = move(self._x[:POSE], odometry.motion)
        P = self._P[:s, :s]
        pose_block = motion.F @ P[:POSE, :POSE] @ motion.F.T + motion.W @ odometry.cov @ motion.W.T
        cross = motion.F @ P[:POSE, POSE:]
        P[:POSE, POSE:], P[POSE:, :POSE] = cross, cross.T
        P[:POSE, :POSE] = 0.5 * (pose_block + pose_block.T)
        self._x[:POSE] = motion.pose_world

    def update(self, first: Observations, second: Observations) -> None:
        """Fuse one scan's matches at once (`second`; a joint filter has no use for `first`)."""
        if not len(second.ids):
            return
        rows = self.belief.rows(second.ids)
        means = self._x[POSE : self._size].reshape(-1, 2)[rows]
        model = innovations(self._x[:POSE], self._anchors[rows], means, second.lines, second.cov)
        m = len(rows)
        # H has five non-zero columns in each pair of rows: multiply P by those alone.
        P = self._P[: self._size, : self._size]
        line_columns = POSE + 2 * rows[:, None] + np.arange(2)
        PHt = np.einsum("smj,mij->smi", P[:, line_columns], model.H_line)
        PHt += np.einsum("sj,mij->smi", P[:, :POSE], model.H_pose)
        PHt = PHt.reshape(self._size, 2 * m)
        S = np.einsum("mij,mjk->mik", model.H_line, PHt[line_columns])
        S += np.einsum("mij,jk->mik", model.H_pose, PHt[:POSE])
        S = S.reshape(2 * m, 2 * m)
        for i in range(m):
            S[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += model.R[i]
        self._condition(PHt, 0.5 * (S + S.T), model.e.ravel())

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Add lines seen in the robot frame, with their correlation to everything known, and return their ids."""
        self._version += 1
        m, s = len(lines), self._size
        self._reserve(s + 2 * m)
        new = grow(self._x[:POSE], lines, centres, self._at_wall)
        P = self._P
        cross = np.einsum("mij,js->mis", new.G_pose, P[:POSE, :s]).reshape(2 * m, s)
        block = np.einsum("mij,kj->mik", new.G_pose, cross[:, :POSE]).reshape(2 * m, 2 * m)
        noise = new.G_line @ cov @ new.G_line.swapaxes(1, 2)
        for i in range(m):
            block[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += noise[i]
        P[s : s + 2 * m, :s], P[:s, s : s + 2 * m] = cross, cross.T
        P[s : s + 2 * m, s : s + 2 * m] = 0.5 * (block + block.T)
        self._x[s : s + 2 * m] = new.means.ravel()
        ids = np.arange(self._next_id, self._next_id + m)
        self._next_id += m
        self._ids = np.concatenate([self._ids, ids])
        self._anchors = np.concatenate([self._anchors, new.anchors])
        return ids

    def merge(self, keep: int, drop: int) -> None:
        """Condition the map on `keep` and `drop` being one line, then forget `drop`."""
        keep_row, drop_row = self.belief.rows([keep, drop])
        means = self._x[POSE : self._size].reshape(-1, 2)
        moved, D = reanchor(means[drop_row], self._anchors[drop_row], self._anchors[keep_row])
        e = moved - means[keep_row]
        e[0] = wrap(e[0])
        P = self._P[: self._size, : self._size]
        keep_columns = slice(POSE + 2 * keep_row, POSE + 2 * keep_row + 2)
        drop_columns = slice(POSE + 2 * drop_row, POSE + 2 * drop_row + 2)
        PHt = P[:, keep_columns] - P[:, drop_columns] @ D.T
        S = PHt[keep_columns] - D @ PHt[drop_columns]
        # Two lines known to be one leave S singular: a thousandth of a millimetre keeps it invertible.
        self._condition(PHt, 0.5 * (S + S.T) + 1e-12 * np.eye(2), e)
        self.remove([drop])

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map."""
        self._version += 1
        kept = np.ones(len(self._ids), dtype=bool)
        kept[self.belief.rows(ids)] = False
        index = self._columns(np.flatnonzero(kept))
        s = len(index)
        self._x[:s] = self._x[index]
        self._P[:s, :s] = self._P[np.ix_(index, index)]
        self._ids, self._anchors = self._ids[kept], self._anchors[kept]

    @property
    def _size(self) -> int:
        return POSE + 2 * len(self._ids)

    def _columns(self, rows: Int[np.ndarray, " m"]) -> Int[np.ndarray, " s"]:
        """Return where the pose and the chosen lines stand in the state."""
        lines = POSE + 2 * rows[:, None] + np.arange(2)
        return np.concatenate([np.arange(POSE), lines.ravel()])

    def _condition(
        self, PHt: Float[np.ndarray, "s k"], S: Float[np.ndarray, "k k"], e: Float[np.ndarray, " k"]
    ) -> None:
        """Apply x += P H' S^-1 e and P -= P H' S^-1 H P, symmetric by construction."""
        self._version += 1
        s = self._size
        root = np.linalg.cholesky(S)
        W = solve_triangular(root, PHt.T, lower=True, check_finite=False).T
        self._x[:s] += W @ solve_triangular(root, e, lower=True, check_finite=False)
        self._x[2] = wrap(self._x[2])
        self._x[POSE:s:2] = wrap(self._x[POSE:s:2])
        self._P[:s, :s] -= W @ W.T

    def _reserve(self, size: int) -> None:
        if size > len(self._x):
            capacity = max(size, 2 * len(self._x))
            x, P = np.zeros(capacity), np.zeros((capacity, capacity))
            old = self._size
            x[:old], P[:old, :old] = self._x[:old], self._P[:old, :old]
            self._x, self._P = x, P
