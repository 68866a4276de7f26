"""The stochastic map in its rigorous form: an extended Kalman filter that keeps every cross-covariance."""

from .kalman.dense_map import DenseMap
from .kalman.ekf import Ekf


class FullEkf(Ekf[DenseMap]):
    """One joint update a scan takes each observation once (Smith et al.)."""

    new_map = DenseMap
