"""The estimators: one file each, and one line in the registry."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from ..estimation.backend import Backend
from .block_ekf import BlockEkf
from .fej_ekf import FejEkf
from .full_ekf import FullEkf
from .invariant_ekf import InvariantEkf
from .joint_block_ekf import JointBlockEkf
from .relocation_ekf import RelocationEkf


@dataclass(frozen=True)
class BackendEntry:
    """How to make a back end from the first pose and its covariance, and what it is."""

    make: Callable[[np.ndarray, np.ndarray], Backend]
    description: str


def _lazily(module: str, name: str) -> Callable[[np.ndarray, np.ndarray], Backend]:
    """Return a maker that imports its module (and the library behind it) when first used."""
    return lambda pose_world, pose_cov: getattr(import_module(f".{module}", __package__), name)(pose_world, pose_cov)


BACKENDS: dict[str, BackendEntry] = {
    "block-ekf": BackendEntry(BlockEkf, "the paper's filter: relocation, then fusion, all cross-covariances neglected"),
    "joint-block-ekf": BackendEntry(JointBlockEkf, "one joint update a scan, then the cross-covariances dropped"),
    "relocation-ekf": BackendEntry(RelocationEkf, "relocation, then fusion, with every cross-covariance kept"),
    "full-ekf": BackendEntry(FullEkf, "EKF with every cross-covariance, one joint update a scan (baseline)"),
    "fej-ekf": BackendEntry(FejEkf, "full EKF with its Jacobians at first estimates: gains nothing unobservable"),
    "invariant-ekf": BackendEntry(InvariantEkf, "full EKF with the right-invariant error: gains nothing unobservable"),
    "graph": BackendEntry(
        _lazily("graph.graph", "Graph"), "factor graph (GTSAM iSAM2): every pose kept and relinearised"
    ),
    "graph-batch": BackendEntry(_lazily("graph.batch", "GraphBatch"), "as graph, and everything optimised at the end"),
}
