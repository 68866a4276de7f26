"""Covariance of relations between poses: from that of the two poses, or estimated from the measurements.

The error of a pose is a small motion delta in its own frame, X_est = X_true Exp(delta). The error of the relation M =
X_i^-1 X_j is then xi = delta_j - Ad(M^-1) delta_i in the frame of the second pose: the motion between M and its true
value.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import minimize

from chainslam.slam.estimation.gates import gate_level, mean_inside
from chainslam.slam.evaluation.consistency import nees
from chainslam.slam.geometry.poses import J, turned

from .relations import Relations, between

LEAST = 1e-4
"""Lower limit of the error of measurements, m and rad."""
GATE = 0.99
"""Level beyond which a residual counts as a mistake."""
ROUNDS = 10
"""Upper limit of the iterations for the most likely error."""


@dataclass(frozen=True)
class Sigmas:
    """The error of a measurement, equal along both axes and independent between measurements."""

    translation_m: float
    rotation_rad: float
    told_by: int = 0
    """Number of residuals that it was estimated from."""
    mistaken: int = 0
    """Number of residuals that were left out as mistakes."""

    @property
    def cov(self) -> Float[np.ndarray, "3 3"]:
        """Its covariance in the plane."""
        return self.cov_of(3)

    def cov_of(self, axes: int) -> Float[np.ndarray, "d d"]:
        """Return its covariance along 3 axes in the plane, or 6 in space."""
        turns = 1 if axes == 3 else 3
        return np.diag(np.square(np.repeat([self.translation_m, self.rotation_rad], [axes - turns, turns])))


@dataclass(frozen=True)
class Misclosures:
    """How t triangles of relations close, along 3 axes in the plane or 6 in space: a to b and on to c against a to c.

    Each of the three relations of a triangle is estimated from the other two; the misclosure is the error of all three.
    """

    rows: Int[np.ndarray, "t 3"]
    """Of the relations a to b, b to c and a to c."""
    left: Float[np.ndarray, "t d"]
    back: Float[np.ndarray, "t d d"]
    """What makes an error of the first relation into one at the end of the second."""

    def covs(self, own: Float[np.ndarray, "d d"]) -> Float[np.ndarray, "t d d"]:
        """Return the covariances of the misclosures where each relation has this one."""
        return np.asarray(2.0 * own + self.back @ own @ self.back.swapaxes(1, 2))

    @property
    def sigmas(self) -> Sigmas | None:
        """The most likely error of a single relation; None if no triangle determines it."""
        return likeliest(self.left, self.covs) if len(self.rows) else None


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
    """Return the error of a single relation in the plane; None if no triangle determines it."""
    rows = triangles(relations)
    ab, bc, ac = (relations.motions[column] for column in rows.T)
    return Misclosures(rows, between(ac, composed(ab, bc)), adjoint_of_inverse(bc)).sigmas


def sigmas_of_path(
    motions: Float[np.ndarray, "m 3"], left: Float[np.ndarray, "m 3"], relation: Sigmas | None
) -> Sigmas | None:
    """Return the error of each pose of a path, given residuals of m relations between its poses; None for m = 0."""
    if not len(left):
        return None
    own = np.zeros((3, 3)) if relation is None else relation.cov
    return likeliest(left, lambda S: own + pose_noise(S, motions))


def likeliest(left: Float[np.ndarray, "m d"], noise: Callable[[np.ndarray], np.ndarray]) -> Sigmas:
    """Return the most likely error, where `noise` is the covariance of the residuals as a function of it.

    Some residuals are gross errors, which are not Gaussian: those beyond the level of 99 % are left out, and the most
    likely error is computed again until it no longer changes. What is left scatters less than all that is Gaussian, by
    a factor that is known and taken out.
    """
    kept = np.ones(len(left), dtype=bool)
    for _ in range(ROUNDS):
        found = _likeliest(left, noise, kept)
        before, kept = kept, nees(left, noise(found.cov_of(left.shape[1]))) <= gate_level(GATE, left.shape[1])
        if not np.any(kept) or np.array_equal(before, kept):
            break
    return replace(found, told_by=int(np.count_nonzero(before)), mistaken=int(np.count_nonzero(~before)))


def _likeliest(
    left: Float[np.ndarray, "m d"], noise: Callable[[np.ndarray], np.ndarray], kept: Bool[np.ndarray, " m"]
) -> Sigmas:
    inside = mean_inside(GATE, left.shape[1])

    def cost(logs: Float[np.ndarray, "2"]) -> float:
        covs = inside * noise(_sigmas(logs).cov_of(left.shape[1]))[kept]
        return float(np.sum(np.linalg.slogdet(covs)[1]) + np.sum(nees(left[kept], covs)))

    return _sigmas(minimize(cost, np.log([0.02, 0.01]), method="Nelder-Mead", options={"xatol": 1e-4}).x)


def _sigmas(logs: Float[np.ndarray, "2"]) -> Sigmas:
    return Sigmas(*(LEAST + np.exp(logs)).tolist())


def composed(first: Float[np.ndarray, "m 3"], second: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
    """Return each motion of `first` with the one of `second` after it."""
    return np.column_stack([first[:, :2] + turned(second[:, :2], first[:, 2]), first[:, 2] + second[:, 2]])
