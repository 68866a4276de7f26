"""Small matrices of a factor graph, in loops: poses carried ahead, lines moved, covariances brought into the world."""

import math

import numpy as np
from jaxtyping import Float

from ...estimation.kernels import innovation_rows
from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import gain_of, whitening, wrapped
from ..frame.kernels import moving


@compiled
def _product(A: Float[np.ndarray, "i j"], B: Float[np.ndarray, "j k"]) -> Float[np.ndarray, "i k"]:
    """Return A B."""
    C = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            for k in range(B.shape[1]):
                C[i, k] += A[i, j] * B[j, k]
    return C


@compiled
def _turn(heading: float) -> Float[np.ndarray, "3 3"]:
    """Return what turns an error of a pose from its body frame into the frame that `heading` rad is given in."""
    turn = np.eye(3)
    turn[0, 0] = turn[1, 1] = math.cos(heading)
    turn[1, 0], turn[0, 1] = math.sin(heading), -math.sin(heading)
    return turn


@compiled
def carry(
    pose: Float[np.ndarray, "3"],
    F: Float[np.ndarray, "3 3"],
    Q: Float[np.ndarray, "3 3"],
    motion: Float[np.ndarray, "3"],
    cov: Float[np.ndarray, "3 3"],
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"], Float[np.ndarray, "3 3"]]:
    """Return the pose after one more motion (robot frame), and how F and Q of `Ahead` go on."""
    W, step, moved = _turn(pose[2]), np.eye(3), np.empty(3)
    x, y = W[0, 0] * motion[0] + W[0, 1] * motion[1], W[1, 0] * motion[0] + W[1, 1] * motion[1]
    moved[0], moved[1], moved[2] = pose[0] + x, pose[1] + y, wrapped(pose[2] + motion[2])
    step[0, 2], step[1, 2] = -y, x
    added = _product(_product(W, cov), W.T)
    return moved, _product(step, F), _product(_product(step, Q), step.T) + added


@compiled
def pose_cov_ahead(
    F: Float[np.ndarray, "3 3"], Q: Float[np.ndarray, "3 3"], cov_body: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "3 3"]:
    """Return F C F' + Q."""
    cov = _product(_product(F, cov_body), F.T) + Q
    return 0.5 * (cov + cov.T)


@compiled
def guess(
    predicted: Float[np.ndarray, "3"],
    motion: Float[np.ndarray, "3"],
    motion_cov: Float[np.ndarray, "3 3"],
    lines: Float[np.ndarray, "m 2"],
    seen: Float[np.ndarray, "m 2"],
    seen_cov: Float[np.ndarray, "m 2 2"],
) -> Float[np.ndarray, "3"]:
    """Return the likeliest pose after `motion`, which led to `predicted`, if the lines (alpha, r) stood where they do.

    The odometry's error of one step bends the prediction of a line three metres away by a millimetre, as much as the
    line is known to. Observations linearised at the predicted pose keep that bend in the map, all to one side; this one
    is a Gauss-Newton step of the pose alone.
    """
    turn, m = _turn(predicted[2] - motion[2]), len(lines)
    cov = _product(_product(turn, motion_cov), turn.T)
    e, H_pose, _, R = innovation_rows(
        predicted, np.zeros((m, 2)), lines, seen, seen_cov, np.zeros(2), np.ascontiguousarray(lines[:, 0])
    )
    H = H_pose.reshape((2 * m, 3))
    PHt = _product(cov, H.T)
    S = _product(H, PHt)
    for k in range(2 * m):
        S[k, k] += R[k // 2, k % 2, k % 2]
    return predicted + _product(gain_of(PHt, whitening(S)), e.reshape((2 * m, 1)))[:, 0]


@compiled
def moved_lines(
    linearised_at: Float[np.ndarray, "n 2"], delta: Float[np.ndarray, " s"], thresholds: Float[np.ndarray, "2"]
) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, " n"], float]:
    """Return lines (alpha, r) moved by `delta`, their chart's (-d alpha, tilt, -d r) one after the other, s = 3 n.

    Besides, how far each has moved in thresholds (rad, m), and the farthest turn rad; a place that is not finite makes
    that NaN.
    """
    lines, astray, farthest = np.empty(linearised_at.shape), np.empty(len(linearised_at)), 0.0
    for k in range(len(lines)):
        turn, shift = -delta[3 * k], -delta[3 * k + 2]
        lines[k, 0], lines[k, 1] = wrapped(linearised_at[k, 0] + turn), linearised_at[k, 1] + shift
        astray[k] = max(abs(turn) / thresholds[0], abs(shift) / thresholds[1])
        if abs(turn) > farthest:
            farthest = abs(turn)
        if not math.isfinite(turn + shift):
            return lines, astray, math.nan
    return lines, astray, farthest


@compiled
def means_world(
    frame_world: Float[np.ndarray, "3"], lines: Float[np.ndarray, "n 2"], anchors: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 2"]:
    """Return lines (alpha, r) of a frame as (alpha, d) in the world, about anchors that are given in the frame, too."""
    means = np.empty(lines.shape)
    for k in range(len(lines)):
        alpha = lines[k, 0]
        means[k, 0] = wrapped(alpha + frame_world[2])
        means[k, 1] = lines[k, 1] - (math.cos(alpha) * anchors[k, 0] + math.sin(alpha) * anchors[k, 1])
    return means


@compiled
def joint_ahead(
    cov: Float[np.ndarray, "s s"],
    F: Float[np.ndarray, "3 3"],
    lines: Float[np.ndarray, "m 2"],
    anchors: Float[np.ndarray, "m 2"],
) -> Float[np.ndarray, "s s"]:
    """Return the covariance of a pose carried ahead by F and of lines (alpha, d) about anchors, all of one frame.

    `cov` is that of the pose, body frame, and of the lines (alpha, r); the pose's own block is not carried.
    """
    ahead = cov.copy()
    # dd = dr - (t·c) dalpha.
    for k in range(len(lines)):
        alpha, at = lines[k, 0], 3 + 2 * k
        lever = math.cos(alpha) * anchors[k, 1] - math.sin(alpha) * anchors[k, 0]
        for j in range(len(cov)):
            ahead[at + 1, j] -= lever * ahead[at, j]
        for j in range(len(cov)):
            ahead[j, at + 1] -= lever * ahead[j, at]
    ahead = 0.5 * (ahead + ahead.T)
    ahead[:3, 3:] = _product(F, ahead[:3, 3:])
    ahead[3:, :3] = ahead[:3, 3:].T
    return ahead


@compiled
def cov_world(
    frame_world: Float[np.ndarray, "3"],
    root: Float[np.ndarray, "3 3"],
    pose_world: Float[np.ndarray, "3"],
    means_world: Float[np.ndarray, "m 2"],
    anchors_world: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "s s"],
) -> Float[np.ndarray, "s s"]:
    """Return a covariance of pose and lines with the frame's own error added, which no scan lessens.

    `root` is one of the frame's covariance.
    """
    moves = _product(moving(frame_world, pose_world, means_world, anchors_world), root)
    return cov + _product(moves, moves.T)


@compiled
def odometry_noise(motion: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the covariance of a motion, given in the frame before it, in the frame after it."""
    turn = _turn(-motion[2])
    return _product(_product(turn, cov), turn.T)
