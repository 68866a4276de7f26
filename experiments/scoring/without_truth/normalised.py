"""Consistency of an estimate with external measurements: errors normalised by their stated covariances."""

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.estimation.backend import PathKeeper
from chainslam.slam.estimation.gates import gate_level
from chainslam.slam.estimation.mounting import body_poses
from chainslam.slam.evaluation.consistency import anees, nees, share_in_band
from chainslam.slam.geometry.poses import inverse
from chainslam.slam.robot import ScannerSpec

from ..trajectories import rms
from .references import References
from .relation_noise import (
    Sigmas,
    adjoint_of_inverse,
    body_covs,
    pose_noise,
    relation_covs,
    sigmas_of_path,
    sigmas_of_relations,
)
from .relations import SAME_TIME_S, Relations, between, nearest_rows
from .smoothing import PairCovs

DOF = 3
FAULTS = (RuntimeError, ValueError, IndexError)
"""Errors of a solver that has lost its solution: nothing is then known about pairs of poses."""


def normalised_relations(
    relations: Relations,
    time_s: Float[np.ndarray, " n"],
    poses_world: Float[np.ndarray, "n 3"],
    pair_covs: PairCovs,
    within_s: float = SAME_TIME_S,
) -> dict[str, Any]:
    """Return the normalised errors of the relations whose times are both those of poses, to `within_s`.

    `pair_covs` returns the joint covariance of the errors of two poses, given their rows. The error of the relation
    itself is added.
    """
    own = sigmas_of_relations(relations)
    first, second, chosen = _at_poses(relations, time_s, within_s)
    motions = between(poses_world[first], poses_world[second])
    covs = relation_covs(motions, pair_covs(first, second))
    left, covs = between(chosen.motions, motions), covs if own is None else covs + own.cov
    known = np.all(np.isfinite(covs), axis=(1, 2))
    far = known & chosen.far
    return {"measured": _record(own), "all": _score(left[known], covs[known]), "far": _score(left[far], covs[far])}


def normalised_path(
    references: References,
    time_s: Float[np.ndarray, " n"],
    poses_world: Float[np.ndarray, "n 3"],
    covs: Float[np.ndarray, "n 3 3"],
    within_s: float = SAME_TIME_S,
) -> dict[str, Any] | None:
    """Return the normalised errors of poses against a reference, both relative to the first pose that they share.

    They share those whose times differ by no more than `within_s`.

    The stated covariance of a pose is taken for that of its error since then, since the first pose of a drive is its
    frame. The error of the reference is estimated from relations a minute and more apart; without any it counts as
    exact.
    """
    if references.path is None:
        return None
    reference_s, reference_world = references.path
    own = _error_of(references, within_s)
    rows, near = nearest_rows(reference_s, time_s, within_s)
    at = np.flatnonzero(near)
    if not len(at):
        return {"measured": _record(own), "all": _score(np.zeros((0, DOF)), np.zeros((0, DOF, DOF)))}
    poses, true = poses_world[at], reference_world[rows[at]]
    motions = between(np.broadcast_to(true[:1], true.shape), true)
    left = between(motions, between(np.broadcast_to(poses[:1], poses.shape), poses))
    stated = body_covs(poses, covs[at])
    stated = stated if own is None else stated + pose_noise(own.cov, motions)
    return {"measured": _record(own), "all": _score(left[1:], stated[1:])}


def pair_covs_of(
    backend: PathKeeper, scanner: ScannerSpec, rows: Int[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "n 3"], PairCovs]:
    """Return the path of the body at rows of a back end's own path, and the joint covariances of its poses."""

    def pair_covs(first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 6 6"]:
        to_body = np.kron(np.eye(2), adjoint_of_inverse(inverse(scanner.pose_robot)[None])[0])
        return np.asarray(to_body @ backend.pair_covs(rows[first], rows[second]) @ to_body.T)

    return body_poses(backend.trajectory()[rows], scanner), pair_covs


def _at_poses(
    relations: Relations, time_s: Float[np.ndarray, " n"], within_s: float
) -> tuple[Int[np.ndarray, " m"], Int[np.ndarray, " m"], Relations]:
    (first, near), (second, also) = (
        nearest_rows(time_s, asked, within_s) for asked in (relations.first_s, relations.second_s)
    )
    chosen = near & also & (first != second)
    return first[chosen], second[chosen], relations.take(chosen)


def _error_of(references: References, within_s: float) -> Sigmas | None:
    """Return the error of a reference path, estimated from relations; None if there are none between its poses."""
    if references.path is None or references.relations is None:
        return None
    time_s, poses_world = references.path
    first, second, chosen = _at_poses(references.relations.take(references.relations.far), time_s, within_s)
    motions = between(poses_world[first], poses_world[second])
    return sigmas_of_path(motions, between(chosen.motions, motions), sigmas_of_relations(references.relations))


def _record(own: Sigmas | None) -> dict[str, Any]:
    """Return the assumed error of the measurements; null if it is unknown."""
    if own is None:
        return dict.fromkeys(("sigma_m", "sigma_rad", "told_by", "mistaken"))
    return {
        "sigma_m": own.translation_m,
        "sigma_rad": own.rotation_rad,
        "told_by": own.told_by,
        "mistaken": own.mistaken,
    }


def _score(left: Float[np.ndarray, "m 3"], covs: Float[np.ndarray, "m 3 3"]) -> dict[str, Any]:
    """Return the mean and the median of the normalised squared errors, each 1 for a consistent estimate."""
    if not len(left):
        return {"count": 0, **dict.fromkeys(("anees", "median", "in_band", "error_m", "stated_m"))}
    values = nees(left, covs)
    return {
        "count": len(left),
        "anees": anees(values, DOF),
        "median": float(np.median(values)) / gate_level(0.5, DOF),
        "in_band": share_in_band(values, DOF),
        "error_m": rms(np.hypot(*left[:, :2].T)),
        "stated_m": float(np.sqrt(np.mean(np.trace(covs[:, :2, :2], axis1=1, axis2=2)))),
    }
