"""Does an estimate know how wrong it is? Pure functions of errors and covariances.

The error of a pose is the right-invariant one, X_est = Exp(xi) X_true in SE(2): a turn and a shift of the whole
world, the directions that no scan can observe, then have the same coordinates wherever the robot stands. The
errors of lines are taken after undoing that motion, so that they are the walls' own (docs/concepts/scores.md).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..estimation.backend import Joint
from ..estimation.gates import gate_level
from ..geometry.lines import normals
from ..geometry.poses import J, rotation, to_robot, turned, wrap


def whitened(errors: Float[np.ndarray, "n d"], covs: Float[np.ndarray, "n d d"]) -> Float[np.ndarray, "n d"]:
    """Return L^-1 e, P = L L', of each error; raises numpy.linalg.LinAlgError where P is not positive definite."""
    return np.asarray(np.linalg.solve(np.linalg.cholesky(covs), errors[..., None])[..., 0])


def nees(errors: Float[np.ndarray, "n d"], covs: Float[np.ndarray, "n d d"]) -> Float[np.ndarray, " n"]:
    """Return e' P^-1 e for each error (n, d); raises numpy.linalg.LinAlgError where P is not positive definite."""
    return np.asarray(np.sum(whitened(errors, covs) ** 2, axis=-1))


def nis(innovations: Float[np.ndarray, "n d"], covs: Float[np.ndarray, "n d d"]) -> Float[np.ndarray, " n"]:
    """Return v' S^-1 v for each innovation (n, d); take it on true associations before gating, which truncates it."""
    return nees(innovations, covs)


def noise_model(nis: float, in_band: float) -> str:
    """Return what a NIS, and the share of steps whose last scans lie in its band, say of the noise model, in a word."""
    if in_band >= 0.5:
        return CONSISTENT
    return "conservative" if nis < 1.0 else "overconfident"


CONSISTENT = "consistent"
NOISE_MODELS = {
    CONSISTENT: "innovations as stated: the noise model is consistent",
    "conservative": "innovations smaller than stated: the noise model is conservative",
    "overconfident": "innovations larger than stated: the noise model is overconfident",
}
"""What each word of `noise_model` means."""


def chi2_band(dof: int, confidence: float = 0.95, runs: int = 1) -> tuple[float, float]:
    """Return the two-sided band that the mean of `runs` independent chi-square variables lies in."""
    tail = 0.5 * (1.0 - confidence)
    return gate_level(tail, dof * runs) / runs, gate_level(1.0 - tail, dof * runs) / runs


def anees(values: Float[np.ndarray, " n"], dof: int) -> float:
    """Return the mean NEES over its degrees of freedom: 1 is ideal, above it the estimate is overconfident."""
    return float(np.mean(values)) / dof


def share_in_band(values: Float[np.ndarray, " n"], dof: int, confidence: float = 0.95) -> float:
    """Return the share of values inside the two-sided chi-square band."""
    low, high = chi2_band(dof, confidence)
    return float(np.mean((values >= low) & (values <= high)))


def pooled_band(runs: Sequence[Float[np.ndarray, " _"]], dof: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the band in which the ANEES over all runs lies for an ideal estimate.

    A run counts as one draw, however many steps it has: an error that lasts as long as the run is one. The ANEES is to
    be the mean of the runs' own means.
    """
    low, high = chi2_band(dof, confidence, max(len(runs), 1))
    return low / dof, high / dof


def bound_margins(
    poses_world: Float[np.ndarray, "s 3"], covs: Float[np.ndarray, "s 3 3"], initial_cov: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, " s"]:
    """Return the smallest eigenvalue of P_k - A P_0 A' at each step, over tr P_0; negative below the bound.

    A = [I, J (p_k - p_0); 0, 1]. An estimator that gains nothing about where the world lies never falls below 0
    (docs/concepts/consistency.md, "The bound").
    """
    A = np.tile(np.eye(3), (len(covs), 1, 1))
    A[:, :2, 2] = (poses_world[:, :2] - poses_world[0, :2]) @ J.T
    gap = covs - A @ initial_cov @ np.swapaxes(A, -1, -2)
    least = np.linalg.eigvalsh(0.5 * (gap + np.swapaxes(gap, -1, -2)))[:, 0]
    return np.asarray(least / np.trace(initial_cov))


def pose_errors(
    estimated_world: Float[np.ndarray, "n 3"], true_world: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Return xi (n, 3), m m rad, of X_est = Exp(xi) X_true; raises nothing, but xi jumps at half a turn."""
    turn = wrap(estimated_world[:, 2] - true_world[:, 2])
    shift = estimated_world[:, :2] - turned(true_world[:, :2], turn)
    # The inverse of V(phi), which carries the translation of Exp: (phi/2) cot(phi/2) on its diagonal.
    half = 0.5 * turn
    diagonal = np.cos(half) / np.sinc(half / np.pi)
    xi = diagonal[:, None] * shift + half[:, None] * np.stack([shift[:, 1], -shift[:, 0]], axis=-1)
    return np.column_stack([xi, turn])


def pose_covariances(
    estimated_world: Float[np.ndarray, "n 3"], covs: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n 3 3"]:
    """Move covariances of plain (x, y, heading) errors to the coordinates of `pose_errors`."""
    to_xi = np.tile(np.eye(3), (len(covs), 1, 1))
    to_xi[:, :2, 2] = -estimated_world[:, :2] @ J.T
    return np.asarray(to_xi @ covs @ np.swapaxes(to_xi, -1, -2))


def joint_error(
    joint: Joint, true_pose_world: Float[np.ndarray, "3"], true_lines_world: Float[np.ndarray, "m 2"]
) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s s"]]:
    """Return the invariant error (s,) of pose and lines together and its covariance (s, s), s = 3 + 2 m.

    The true lines are (alpha rad, r m) in the world frame. With E = X_est X_true^-1 an estimated line is moved by
    E^-1 and compared with the true one at its own anchor; to first order e_alpha = d_alpha - d_theta and
    e_d = dd - n·(dp - J (p - c) d_theta).
    """
    pose, lines = joint.mean[:3], joint.mean[3:].reshape(-1, 2)
    turn = wrap(pose[2] - true_pose_world[2])
    shift = pose[:2] - rotation(float(turn)) @ true_pose_world[:2]
    anchors = to_robot(joint.anchors, np.array([shift[0], shift[1], turn]))
    alpha = wrap(lines[:, 0] - turn - true_lines_world[:, 0])
    true_d = true_lines_world[:, 1] - np.vecdot(normals(true_lines_world[:, 0]), anchors)
    xi = pose_errors(pose[None], true_pose_world[None])[0]
    error = np.concatenate([xi, np.stack([alpha, lines[:, 1] - true_d], axis=-1).ravel()])
    to_error = _to_invariant(pose, lines[:, 0], joint.anchors)
    return error, to_error @ joint.cov @ to_error.T


def _to_invariant(
    pose_world: Float[np.ndarray, "3"], alpha: Float[np.ndarray, " m"], anchors: Float[np.ndarray, "m 2"]
) -> Float[np.ndarray, "s s"]:
    """Return the matrix (s, s) from plain errors (pose, alpha_i, d_i) to invariant ones."""
    to_error = np.eye(3 + 2 * len(alpha))
    to_error[:2, 2] = -J @ pose_world[:2]
    n = normals(alpha)
    to_error[3::2, 2] = -1.0
    to_error[4::2, :2] = -n
    to_error[4::2, 2] = np.vecdot(n, (pose_world[:2] - anchors) @ J.T)
    return to_error
