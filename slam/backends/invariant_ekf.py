"""The right-invariant error in plain coordinates: P follows the estimate's own corrections (docs/estimation.md)."""

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import POSE, Observations
from ..estimation.models import Linear, stack
from .kalman.dense_map import DenseMap
from .kalman.ekf import Ekf
from .kalman.linear import carry


class InvariantEkf(Ekf[DenseMap]):
    """The full filter, with P carried along after each correction: P <- D P D'."""

    new_map = DenseMap

    def _begin(self) -> None:
        super()._begin()
        self._carried_to: tuple[np.ndarray, np.ndarray] | None = None
        """Position (2,) and directions (n,) at which P holds its errors while an update is on its way."""

    def _linear(self, rows: Int[np.ndarray, " m"], seen: Observations) -> Linear:
        """Linearise a scan where it takes the estimate (one Gauss-Newton iteration), and carry P there first.

        There H finds the unobservable directions of P, wherever it is; the innovation is that of the estimate as it is.
        """
        here = stack(rows, self._innovations(rows, seen, self._map.pose_world, self._map.means[rows]))
        if not self._config.relinearise:
            return here
        joint = self._map.joint(here.rows)
        PHt = joint.cov @ here.H.T
        step = PHt @ np.linalg.solve(here.H @ PHt + here.R, here.e)
        ahead = joint.mean + step
        self._carry_to(here.rows, ahead)
        means = ahead[POSE:].reshape(-1, 2)[np.argmax(here.rows == rows[:, None], axis=1)]
        there = stack(rows, self._innovations(rows, seen, ahead[:POSE], means))
        return Linear(there.rows, there.H, there.e + there.H @ step, there.R)

    def _carry_to(self, rows: Int[np.ndarray, " u"], ahead: Float[np.ndarray, " s"]) -> None:
        """Carry P to other means of the pose and these rows."""
        position, alpha = self._point()
        turned = alpha.copy()
        turned[rows] = ahead[POSE::2]
        self._carry(position, ahead[:2], alpha, turned)
        self._carried_to = ahead[:2], turned

    def _condition(self, model: Linear) -> None:
        position, alpha = self._point()
        super()._condition(model)
        self._carried_to = None
        self._carry(position, self._map.pose_world[:2], alpha, self._map.means[:, 0])

    def _point(self) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, " n"]]:
        """Return the position and directions at which P holds its errors."""
        return self._carried_to or (self._map.pose_world[:2], self._map.means[:, 0])

    def _carry(
        self,
        position: Float[np.ndarray, "2"],
        moved: Float[np.ndarray, "2"],
        alpha: Float[np.ndarray, " n"],
        turned: Float[np.ndarray, " n"],
    ) -> None:
        """Carry P from one position and directions to others."""
        self._map.shear(*carry(position, moved, alpha, turned, self._map.anchors))

    def _align(self, rows: Int[np.ndarray, "2"]) -> float:
        """Take the line dropped to the direction of the line kept: else their equality says where the world lies."""
        alpha = self._map.means[:, 0]
        turned = alpha.copy()
        turned[rows[1]] = turned[rows[0]]
        position = self._map.pose_world[:2]
        self._carry(position, position, alpha, turned)
        return float(turned[rows[0]])
