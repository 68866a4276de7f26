"""Observations of several lines taken together: where they put the pose and the lines."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import Joint, Observations
from ..geometry.matrix_kernels import gain_of
from .kernels import joint_kernels


@dataclass(frozen=True)
class JointObservations:
    """What m observations of a joint Gaussian's lines say of its pose and lines."""

    e: Float[np.ndarray, " k"]
    """How they differ from what the mean predicts, k = 2 m."""
    H_pose: Float[np.ndarray, "k 3"]
    """Minus the derivative of e by the pose."""
    PHt: Float[np.ndarray, "s k"]
    """Covariance of the state with e."""
    S: Float[np.ndarray, "k k"]
    """Covariance of e."""
    W: Float[np.ndarray, "k k"]
    """What whitens e, W S W' = I."""


@dataclass(frozen=True)
class Nis:
    """How far a scan's observations lie from what was predicted of them, together."""

    squared: float
    """Normalised innovation squared, e' S^-1 e: of a chi-square variable if the belief is honest."""
    dof: int
    """Its degrees of freedom, two for each observation."""


NO_NIS = Nis(0.0, 0)


def relocate(joint: Joint, seen: JointObservations) -> Joint:
    """Condition the joint Gaussian on observations of some of its lines (paper, step 3), as a pure function."""
    if not len(seen.e):
        return joint
    gain = gain_of(seen.PHt, seen.W)
    return Joint(joint.mean + gain @ seen.e, joint.cov - gain @ seen.PHt.T, joint.anchors)


def seen_halfway(joint: Joint, ids: Int[np.ndarray, " n"], observed: Observations) -> JointObservations:
    """Join observations of some of the joint's lines, linearised halfway to where they put the pose."""
    rows = np.searchsorted(ids, observed.ids)
    return JointObservations(
        *joint_kernels.seen_halfway(
            joint.mean, np.ascontiguousarray(joint.cov), joint.anchors, rows, observed.lines, observed.cov
        )
    )
