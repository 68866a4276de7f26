"""Observations of several lines taken together: where they put the pose and the lines."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import Joint, Observations
from ..geometry.matrix_kernels import gain_of, whitening
from .kernels import joint_kernels


@dataclass(frozen=True)
class JointObservations:
    """What m observations of a joint Gaussian's lines say of its pose and lines."""

    e: Float[np.ndarray, " k"]
    """How they differ from what the mean predicts, k = 2 m."""
    H_pose: Float[np.ndarray, "m 2 3"]
    """Minus the derivative of e by the pose."""
    PHt: Float[np.ndarray, "s k"]
    """Covariance of the state with e."""
    S: Float[np.ndarray, "k k"]
    """Covariance of e."""

    def gain(self) -> Float[np.ndarray, "s k"]:
        """Return by how much each part of e moves the state."""
        return gain_of(self.PHt, whitening(self.S))


@dataclass(frozen=True)
class Nis:
    """How far a scan's observations lie from what was predicted of them, together."""

    squared: float
    """Normalised innovation squared, e' S^-1 e: of a chi-square variable if the belief is honest."""
    dof: int
    """Its degrees of freedom, two for each observation."""


NO_NIS = Nis(0.0, 0)


def relocate(joint: Joint, ids: Int[np.ndarray, " n"], observed: Observations) -> Joint:
    """Condition the joint Gaussian on observations of some of its lines (paper, step 3), as a pure function."""
    if not len(observed.ids):
        return joint
    seen = seen_halfway(joint, ids, observed)
    gain = seen.gain()
    return Joint(joint.mean + gain @ seen.e, joint.cov - gain @ seen.PHt.T, joint.anchors)


def seen_halfway(joint: Joint, ids: Int[np.ndarray, " n"], observed: Observations) -> JointObservations:
    """Join observations of some of the joint's lines, linearised halfway to where they put the pose."""
    rows = np.searchsorted(ids, observed.ids)
    e, H_pose, PHt, S = joint_kernels.seen_halfway(
        joint.mean, np.ascontiguousarray(joint.cov), joint.anchors, rows, observed.lines, observed.cov
    )
    return JointObservations(e.ravel(), H_pose, PHt, S)
