"""The estimators: one file each, and one line in the registry."""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from msgspec import convert

from ..estimation.backend import Backend
from .graph.config import GraphConfig
from .kalman.config import EkfConfig


@dataclass(frozen=True)
class BackendOptions:
    """Options of the estimators."""

    ekf: EkfConfig = field(default_factory=EkfConfig)
    """Used by every Kalman filter."""
    graph: GraphConfig = field(default_factory=GraphConfig)
    """Used by both factor graphs."""
    own: dict[str, dict[str, Any]] = field(default_factory=dict, hash=False)
    """Options of your own estimators: by the name of their options class, and the name of each option."""

    def of(self, kind: type) -> Any:
        """Return the options of a class; raises msgspec.ValidationError for values that are not of it."""
        known = next((each for each in vars(self).values() if type(each) is kind), None)
        return convert(self.own.get(kind.__name__, {}), kind) if known is None else known


@dataclass(frozen=True)
class BackendEntry:
    """An entry of the registry of back ends."""

    kind: Callable[..., Backend]
    """Class or function that makes one from the initial pose, its covariance and, if there are any, its options."""
    description: str
    options: type | None = None
    """Dataclass of its options, if it has any."""
    covariance: Literal["exact", "blocks", "bound"] = "exact"
    """Whether its covariance is that of its errors to first order, only the diagonal blocks of it, or a bound."""
    is_about_origin: bool = False
    """Whether its estimate depends on the position of the world's origin."""
    keeps_frame: bool = False
    """Whether it gains no information along the unobservable directions: the position and heading of everything."""
    carries_start: bool = False
    """Whether the pose's covariance is exactly the start's, transported along the path, plus the error since then."""
    version: str | None = None
    """Version of an estimator that is not chainslam's own, for the rows of `chainslam benchmark`."""
    command: tuple[str, ...] = ()
    """Words that start the program of `--external`, which tells the pose in place of this back end."""

    def make(
        self,
        pose_world: Float[np.ndarray, "3"],
        pose_cov: Float[np.ndarray, "3 3"],
        options: BackendOptions = BackendOptions(),
    ) -> Backend:
        """Return a back end with this initial pose and covariance, and an empty map."""
        return self.kind(pose_world, pose_cov, *([] if self.options is None else [options.of(self.options)]))


def _lazily(module: str, name: str) -> Callable[..., Backend]:
    """Return a maker that imports its module (and the library behind it) when first used."""

    def make(*args: Any) -> Backend:
        backend: Backend = getattr(import_module(f".{module}", __package__), name)(*args)
        return backend

    return make


def _filter(module: str, name: str, description: str, **properties: Any) -> BackendEntry:
    return BackendEntry(_lazily(module, name), description, EkfConfig, **properties)


BACKENDS: dict[str, BackendEntry] = {
    "block-ekf": _filter(
        "blocks.block_ekf",
        "BlockEkf",
        "the paper's filter: relocation, then fusion, all cross-covariances neglected",
        covariance="blocks",
    ),
    "joint-block-ekf": _filter(
        "blocks.joint_block_ekf",
        "JointBlockEkf",
        "one joint update a scan, then the cross-covariances dropped",
        covariance="blocks",
    ),
    "relocation-ekf": _filter(
        "relocation_ekf", "RelocationEkf", "relocation, then fusion, with every cross-covariance kept"
    ),
    "full-ekf": _filter("full_ekf", "FullEkf", "EKF with every cross-covariance, one joint update a scan (baseline)"),
    "fej-ekf": _filter(
        "fej_ekf",
        "FejEkf",
        "full EKF with its Jacobians at first estimates: gains nothing unobservable",
        keeps_frame=True,
    ),
    "invariant-ekf": _filter(
        "invariant_ekf",
        "InvariantEkf",
        "full EKF with the right-invariant error: gains nothing unobservable",
        keeps_frame=True,
        carries_start=True,
    ),
    "graph": BackendEntry(
        _lazily("graph.graph", "Graph"),
        "factor graph (GTSAM iSAM2): every pose kept and relinearised",
        GraphConfig,
        keeps_frame=True,
        carries_start=True,
    ),
    "graph-batch": BackendEntry(
        _lazily("graph.batch", "GraphBatch"),
        "as graph, and everything optimised at the end",
        GraphConfig,
        keeps_frame=True,
        carries_start=True,
    ),
    "textbook-ekf": BackendEntry(
        _lazily("textbook_ekf", "TextbookEkf"),
        "full EKF as in textbooks: lines about the world's origin, linearised where the odometry ends",
        is_about_origin=True,
    ),
    "iterated-ekf": _filter(
        "iterated_ekf", "IteratedEkf", "full EKF that linearises each scan again where its own update leads"
    ),
    "intersection-ekf": _filter(
        "blocks.intersection_ekf",
        "IntersectionEkf",
        "split covariance intersection: the paper's diagonal blocks, each a bound whatever was dropped",
        covariance="bound",
    ),
    "ukf": _filter("ukf", "Ukf", "unscented Kalman filter: the models' own mean and spread in place of Jacobians"),
    "oc-ekf": _filter(
        "oc_ekf",
        "OcEkf",
        "observability-constrained EKF: as the invariant one, P changed least",
        keeps_frame=True,
    ),
}
BUILT_IN = frozenset(BACKENDS)
"""What comes along; other names are a user's own, of which the processes of a campaign are told."""
