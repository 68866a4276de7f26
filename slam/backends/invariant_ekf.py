"""The right-invariant error in plain coordinates: P follows the estimate's corrections (docs/concepts)."""

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import POSE, Observations
from ..estimation.models import Linear, stack
from .kalman.dense_map import DenseMap
from .kalman.ekf import Ekf
from .kalman.linear import carry

Point = tuple[Float[np.ndarray, "2"], Float[np.ndarray, " n"]]
"""A position and the directions of all lines: where errors are linearised."""


class InvariantEkf(Ekf[DenseMap]):
    """The full filter, with P carried along after each correction: P <- D P D'."""

    new_map = DenseMap

    def _begin(self) -> None:
        super()._begin()
        self._carried_to: Point | None = None
        """Where P holds its errors while an update is on its way."""

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
        before = self._point()
        turned = before[1].copy()
        turned[rows] = ahead[POSE::2]
        self._carry(before, (ahead[:2], turned))
        self._carried_to = ahead[:2], turned

    def _condition(self, model: Linear) -> None:
        before = self._point()
        super()._condition(model)
        self._carried_to = None
        self._carry(before, self._point())

    def _point(self) -> Point:
        """Return the position and directions at which P holds its errors."""
        return self._carried_to or (self._map.pose_world[:2], self._map.means[:, 0])

    def _carry(self, before: Point, after: Point) -> None:
        """Carry P from one position and directions to others."""
        (position, alpha), (moved, turned) = before, after
        self._map.shear(*carry(position, moved, alpha, turned, self._map.anchors))

    def _align(self, rows: Int[np.ndarray, "2"]) -> float:
        """Take the line dropped to the direction of the line kept: else their equality says where the world lies."""
        position, alpha = self._point()
        turned = alpha.copy()
        turned[rows[1]] = turned[rows[0]]
        self._carry((position, alpha), (position, turned))
        return float(turned[rows[0]])
