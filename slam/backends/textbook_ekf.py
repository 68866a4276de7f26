"""The EKF of the textbooks: the paper's lines about the world's origin, and no Jacobian taken twice."""

import numpy as np
from jaxtyping import Float

from .full_ekf import FullEkf
from .kalman.config import EkfConfig


class TextbookEkf(FullEkf):
    """The full filter of Smith et al., without anchors at the walls and without a second linearisation."""

    def __init__(self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"]) -> None:
        """Start at a pose with its covariance and an empty map."""
        super().__init__(pose_world, pose_cov, EkfConfig(at_wall=False, relinearise=False))
