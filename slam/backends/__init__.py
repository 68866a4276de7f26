"""The estimators: one file each, and one line in the registry."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..backend import Backend
from .full_ekf import FullEkf


@dataclass(frozen=True)
class BackendEntry:
    """How to make a back end from the first pose and its covariance, and what it is."""

    make: Callable[[np.ndarray, np.ndarray], Backend]
    description: str


BACKENDS: dict[str, BackendEntry] = {
    "full-ekf": BackendEntry(FullEkf, "EKF with every cross-covariance, one joint update a scan (baseline)"),
}
