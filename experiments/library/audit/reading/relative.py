"""What a trajectory states of relations between its poses."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..draws import Cross
from ..geometry.kinds import geometry_of
from ..geometry.plane import Frame
from .stated import Stated


@dataclass(frozen=True)
class Relative:
    """The covariances of m relations between poses, each in the frame of its second pose."""

    covs: Float[np.ndarray, "m d d"]
    is_bound: bool
    """Whether they are the largest possible, 2 (P_a + P_b), since the correlation of two poses is not stated."""
    cross: Cross | None
    """Those of all relations with some, where they are known."""


def relative(stated: Stated, first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"], frame: Frame) -> Relative:
    """Return what is stated of relations between poses, given their rows."""
    by, own = geometry_of(stated.poses_world), stated.used_covs
    motions = by.between(stated.poses_world[first], stated.poses_world[second])
    if stated.pair_covs is not None and (of_poses := stated.cross_covs) is not None:
        A = by.adjoint_of_inverse(motions)

        def cross(some: Int[np.ndarray, " k"]) -> Float[np.ndarray, "m d k d"]:
            at = of_poses(second[some]) - np.einsum("nakb,kcb->nakc", of_poses(first[some]), A[some])
            return np.asarray(at[second] - np.einsum("mab,mbkc->makc", A, at[first]))

        return Relative(by.relation_covs(motions, stated.pair_covs(first, second)), False, cross)
    assert own is not None
    body = [by.to_frame(stated.poses_world[rows], own[rows], frame, "body") for rows in (first, second)]
    joint, axes = np.zeros((len(first), 2 * own.shape[1], 2 * own.shape[1])), own.shape[1]
    joint[:, :axes, :axes], joint[:, axes:, axes:] = body
    return Relative(2.0 * by.relation_covs(motions, joint), True, None)
