"""The stochastic map in its rigorous form: an extended Kalman filter that keeps every cross-covariance."""

import numpy as np
from jaxtyping import Float

from .kalman.dense_map import DenseMap
from .kalman.ekf import Ekf


class FullEkf(Ekf[DenseMap]):
    """One joint update a scan takes each observation once (Smith et al.)."""

    def __init__(
        self,
        pose_world: Float[np.ndarray, "3"],
        pose_cov: Float[np.ndarray, "3 3"],
        *,
        at_wall: bool = True,
        relinearise: bool = True,
    ) -> None:
        """Start at a pose with its covariance and an empty map; see `Ekf`."""
        super().__init__(DenseMap(pose_world, pose_cov), at_wall, relinearise)
