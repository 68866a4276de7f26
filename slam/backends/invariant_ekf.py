"""The right-invariant error in plain coordinates: P follows the estimate's corrections (docs/concepts)."""

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import POSE, Observations
from ..estimation.models import stack
from .kalman.dense_map import DenseMap
from .kalman.ekf import Ekf
from .kalman.linear import carry

Point = tuple[Float[np.ndarray, "2"], Float[np.ndarray, " n"]]
"""A position and the directions of all lines: where errors are linearised."""


class InvariantEkf(Ekf[DenseMap]):
    """The full filter, with P carried along after each correction: P <- D P D'."""

    new_map = DenseMap

    def observe(self, rows: Int[np.ndarray, " m"], seen: Observations) -> None:
        """Linearise a scan where it takes the estimate (one Gauss-Newton iteration), with P carried there first.

        There H finds the unobservable directions of P, wherever it is; the innovation is that of the estimate as it is.
        """
        at = self._point()
        model = stack(rows, self.compare(rows, seen, self.map.pose_world, self.map.means[rows]))
        if self.config.relinearise:
            joint = self.map.joint(model.rows)
            PHt = joint.cov @ model.H.T
            step = PHt @ np.linalg.solve(model.H @ PHt + model.R, model.e)
            ahead, turned = joint.mean + step, at[1].copy()
            turned[model.rows] = ahead[POSE::2]
            before, at = at, (ahead[:2], turned)
            self._carry(before, at)
            means = ahead[POSE:].reshape(-1, 2)[model.place]
            model = stack(rows, self.compare(rows, seen, ahead[:POSE], means)).before(step)
        self.map.condition(model)
        self._carry(at, self._point())

    def unite(self, rows: Int[np.ndarray, "2"]) -> None:
        """Take the line dropped to the direction of the line kept: else their equality says where the world lies."""
        position, alpha = before = self._point()
        turned = alpha.copy()
        turned[rows[1]] = turned[rows[0]]
        self._carry(before, (position, turned))
        self._equate(rows, float(turned[rows[0]]))
        self._carry(before, self._point())

    def _point(self) -> Point:
        """Return the position and directions of the estimate."""
        return self.map.pose_world[:2], self.map.means[:, 0]

    def _carry(self, before: Point, after: Point) -> None:
        """Carry P from one position and directions to others."""
        (position, alpha), (moved, turned) = before, after
        self.map.shear(*carry(position, moved, alpha, turned, self.map.anchors))
