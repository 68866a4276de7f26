"""The iterated EKF: each scan is linearised again and again where its own update leads (Bell and Cathey, 1993)."""

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import POSE, Observations
from ..estimation.models import Linear, stack
from .kalman.dense_map import DenseMap
from .kalman.ekf import Ekf

MOST = 10
STILL = 1e-9
"""What moves by less, m and rad, has arrived."""


class IteratedEkf(Ekf[DenseMap]):
    """The full filter whose update is the least-squares solution of the scan and all that was known before it."""

    new_map = DenseMap

    def linearise(self, rows: Int[np.ndarray, " m"], seen: Observations) -> Linear:
        """Linearise a scan at its own solution by Gauss-Newton iterations of the pose and the lines seen."""
        model = stack(rows, self.compare(rows, seen, self.map.pose_world, self.map.means[rows]))
        prior = self.map.joint(model.rows)
        step: Float[np.ndarray, " s"] = np.zeros(len(prior.mean))
        for _ in range(MOST if self.config.relinearise else 0):
            before, PHt = step, prior.cov @ model.H.T
            step = PHt @ np.linalg.solve(model.H @ PHt + model.R, model.e)
            at = prior.mean + step
            means = at[POSE:].reshape(-1, 2)[model.place]
            model = stack(rows, self.compare(rows, seen, at[:POSE], means)).before(step)
            if np.abs(step - before).max() < STILL:
                break
        return model
