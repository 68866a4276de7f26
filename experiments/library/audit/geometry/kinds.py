"""The plane and space as one: what an audit asks of the geometry of poses."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ....scoring.without_truth.relation_noise import Misclosures, triangles
from ....scoring.without_truth.relations import Relations
from . import plane, space
from .plane import Frame

Poses = Float[np.ndarray, "n p"]
Errors = Float[np.ndarray, "n d"]
Covs = Float[np.ndarray, "n d d"]


@runtime_checkable
class Geometry(Protocol):
    """The functions of the modules `plane` (poses of 3 numbers, errors of 3) and `space` (of 7, and of 6)."""

    def errors(self, estimated: Poses, true: Poses, frame: Frame) -> Errors:
        """Return the errors of poses."""

    def coordinates(self, motions: Poses) -> Errors:
        """Return shift and turn of motions."""

    def motions_of(self, coordinates: Errors) -> Poses:
        """Return the motions of shifts and turns."""

    def slopes(self, motions: Poses) -> Covs:
        """Return the derivatives of the coordinates of motions by a small motion after each."""

    def adjoint_of_inverse(self, motions: Poses) -> Covs:
        """Return what makes a small motion before a motion into one after it."""

    def composed(self, first: Poses, second: Poses) -> Poses:
        """Return each motion of the first with that of the second after it."""

    def to_frame(self, estimated: Poses, covs: Covs, given: Frame, wanted: Frame) -> Covs:
        """Return covariances of errors in one frame as those in another."""

    def moved(self, poses: Poses, motion: Float[np.ndarray, " p"]) -> Poses:
        """Return poses after a rigid motion of the world."""

    def moved_covs(self, covs: Covs, motion: Float[np.ndarray, " p"], frame: Frame) -> Covs:
        """Return covariances after a rigid motion of the world."""

    def motion_at_start(self, estimated: Poses, true: Poses) -> Float[np.ndarray, " p"]:
        """Return the motion that brings the first pose to the true one."""

    def alignment_of_paths(self, estimated: Poses, true: Poses) -> Float[np.ndarray, " p"]:
        """Return the motion that brings the path nearest to the true one."""

    def about(self, poses: Poses, place: Float[np.ndarray, " p"]) -> Poses:
        """Return poses with the origin moved to a position."""

    def between(self, first: Poses, second: Poses) -> Poses:
        """Return each second pose in the frame of the first."""

    def relation_covs(self, motions: Poses, pair_covs: Float[np.ndarray, "m e e"]) -> Covs:
        """Return the covariance of relations by that of both poses."""

    def interpolated(self, time_s: np.ndarray, poses: Poses, asked_s: np.ndarray) -> Poses:
        """Return poses between those of a path."""


def geometry_of(poses: Poses) -> Geometry:
    """Return the geometry of poses by how many numbers they have."""
    return plane if poses.shape[1] == plane.NUMBERS else space


def parts(axes: int) -> tuple[slice, slice]:
    """Return which of the axes of errors, 3 or 6, are of the position, and which of the rotation."""
    at = 2 if axes == plane.NUMBERS else 3
    return slice(0, at), slice(at, axes)


def misclosures(relations: Relations) -> Misclosures:
    """Return how relations in the plane or in space close triangles."""
    by, rows = geometry_of(relations.motions), triangles(relations)
    ab, bc, ac = (relations.motions[column] for column in rows.T)
    return Misclosures(rows, by.coordinates(by.between(ac, by.composed(ab, bc))), by.adjoint_of_inverse(bc))


def since_start(
    estimated: Poses, true: Poses, covs: Covs, frame: Frame
) -> tuple[Float[np.ndarray, "m d"], Float[np.ndarray, "m d d"]]:
    """Return the errors of the poses relative to the first one, and their covariances, which may be none.

    The error of the first pose is taken for one that the estimate carries along, as one that nothing observes: in the
    world frame about the start, errors and covariances since then only add up.
    """
    by = geometry_of(estimated)
    motion = by.motion_at_start(estimated, true)
    plain = by.to_frame(estimated, covs, frame, "additive")
    stated = by.to_frame(by.about(estimated, estimated[0]), plain, "additive", "world")
    left = by.errors(by.about(by.moved(estimated, motion), true[0]), by.about(true, true[0]), "world")
    return left[1:], by.moved_covs(stated - stated[0], motion, "additive")[1:]
