"""One joint update, then the correlations dropped: what that alone costs, without the relocation-fusion scheme."""

import numpy as np
from jaxtyping import Float

from .kalman.block_map import BlockMap
from .kalman.ekf import Ekf


class JointBlockEkf(Ekf[BlockMap]):
    """The full filter's update on a map that keeps the diagonal blocks alone."""

    def __init__(
        self,
        pose_world: Float[np.ndarray, "3"],
        pose_cov: Float[np.ndarray, "3 3"],
        *,
        at_wall: bool = True,
        relinearise: bool = True,
    ) -> None:
        """Start at a pose with its covariance and an empty map; see `Ekf`."""
        super().__init__(BlockMap(pose_world, pose_cov), at_wall, relinearise)
