"""How uncertain relations between poses are: by the covariance of the two poses, or by what measured them.

An error of a pose is a small motion delta in its own frame, X_est = X_true Exp(delta). The relation M = X_i^-1 X_j then
errs by xi = delta_j - Ad(M^-1) delta_i in the frame of the second pose, which is what is left between M and its truth.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import minimize

from chainslam.slam.estimation.gates import gate_level
from chainslam.slam.evaluation.consistency import nees
from chainslam.slam.geometry.poses import J, turned

from .relations import Relations, between

LEAST = 1e-4
"""Nothing measured is taken for better than this, m and rad."""
ROUNDS = 10
"""The likeliest error is sought so often at most."""


@dataclass(frozen=True)
class Sigmas:
    """The error of something measured, the same along both axes and independent from one to the next."""

    translation_m: float
    rotation_rad: float
    told_by: int = 0
    """So many residuals tell it ..."""
    mistaken: int = 0
    """... and so many were left out as mistakes."""

    @property
    def cov(self) -> Float[np.ndarray, "3 3"]:
        """Its covariance."""
        return np.diag(np.square([self.translation_m, self.translation_m, self.rotation_rad]))


def adjoint_of_inverse(motions: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Return Ad(M^-1) of each motion M: a small motion made before M, as it would be made after M."""
    c, s = np.cos(motions[:, 2]), np.sin(motions[:, 2])
    A = np.zeros((len(motions), 3, 3))
    A[:, 0, 0], A[:, 0, 1], A[:, 1, 0], A[:, 1, 1], A[:, 2, 2] = c, s, -s, c, 1.0
    A[:, :2, 2] = (A[:, :2, :2] @ (motions[:, :2] @ J.T)[..., None])[..., 0]
    return A


def relation_covs(
    motions: Float[np.ndarray, "m 3"], pair_covs: Float[np.ndarray, "m 6 6"]
) -> Float[np.ndarray, "m 3 3"]:
    """Return the covariance of relations, given those of both poses' errors together, each in its body frame."""
    G = np.concatenate([-adjoint_of_inverse(motions), np.broadcast_to(np.eye(3), (len(motions), 3, 3))], axis=-1)
    return np.asarray(G @ pair_covs @ G.swapaxes(1, 2))


def body_covs(poses_world: Float[np.ndarray, "n 3"], covs: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return covariances of (x, y, heading) in the world frame as those in the frame of each pose."""
    c, s = np.cos(poses_world[:, 2]), np.sin(poses_world[:, 2])
    turn = np.zeros((len(covs), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, s, -s, c, 1.0
    return np.asarray(turn @ covs @ turn.swapaxes(1, 2))


def pose_noise(S: Float[np.ndarray, "3 3"], motions: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3 3"]:
    """Return the covariance of relations between poses whose errors are independent, of covariance S each."""
    A = adjoint_of_inverse(motions)
    return np.asarray(S + A @ S @ A.swapaxes(1, 2))


def triangles(relations: Relations) -> Int[np.ndarray, "t 3"]:
    """Return the rows (a to b, b to c, a to c) of relations that close a triangle, by their times to 1 ms."""
    times_ms = np.round(1e3 * np.stack([relations.first_s, relations.second_s])).astype(np.int64)
    rows = {(a, b): row for row, (a, b) in enumerate(times_ms.T.tolist())}
    onward: dict[int, list[int]] = {}
    for a, b in rows:
        onward.setdefault(a, []).append(b)
    found = [(row, rows[b, c], rows[a, c]) for (a, b), row in rows.items() for c in onward.get(b, ()) if (a, c) in rows]
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def sigmas_of_relations(relations: Relations) -> Sigmas | None:
    """Return the error of a relation itself; None where no triangle tells it.

    Of three relations around a triangle each is told twice: what does not close is the error of all three.
    """
    rows = triangles(relations)
    if not len(rows):
        return None
    ab, bc, ac = (relations.motions[column] for column in rows.T)
    back = adjoint_of_inverse(bc)

    def noise(S: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "t 3 3"]:
        return np.asarray(2.0 * S + back @ S @ back.swapaxes(1, 2))

    return likeliest(between(ac, _composed(ab, bc)), noise)


def sigmas_of_path(
    motions: Float[np.ndarray, "m 3"], left: Float[np.ndarray, "m 3"], relation: Sigmas | None
) -> Sigmas | None:
    """Return the error of each pose of a path, of which m relations between its poses leave `left`; None for m = 0."""
    if not len(left):
        return None
    own = np.zeros((3, 3)) if relation is None else relation.cov
    return likeliest(left, lambda S: own + pose_noise(S, motions))


def likeliest(left: Float[np.ndarray, "m 3"], noise: Callable[[np.ndarray], np.ndarray]) -> Sigmas:
    """Return the error under which `noise`, a function of its covariance, makes the residuals likeliest.

    Some residuals are mistakes, of which no Gaussian tells: those beyond the level of 99 % are left out, and the
    likeliest error is sought again, until it stays.
    """
    kept = np.ones(len(left), dtype=bool)
    for _ in range(ROUNDS):
        found = _likeliest(left, noise, kept)
        before, kept = kept, nees(left, noise(found.cov)) <= gate_level(0.99, 3)
        if not np.any(kept) or np.array_equal(before, kept):
            break
    return replace(found, told_by=int(np.count_nonzero(before)), mistaken=int(np.count_nonzero(~before)))


def _likeliest(
    left: Float[np.ndarray, "m 3"], noise: Callable[[np.ndarray], np.ndarray], kept: Bool[np.ndarray, " m"]
) -> Sigmas:
    def cost(logs: Float[np.ndarray, "2"]) -> float:
        covs = noise(_sigmas(logs).cov)[kept]
        return float(np.sum(np.linalg.slogdet(covs)[1]) + np.sum(nees(left[kept], covs)))

    return _sigmas(minimize(cost, np.log([0.02, 0.01]), method="Nelder-Mead", options={"xatol": 1e-4}).x)


def _sigmas(logs: Float[np.ndarray, "2"]) -> Sigmas:
    return Sigmas(*(LEAST + np.exp(logs)).tolist())


def _composed(first: Float[np.ndarray, "m 3"], second: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
    """Return each motion of `first` with the one of `second` after it."""
    return np.column_stack([first[:, :2] + turned(second[:, :2], first[:, 2]), first[:, 2] + second[:, 2]])
