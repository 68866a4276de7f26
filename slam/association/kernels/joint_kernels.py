"""The joint Gaussian of pose and lines, as observations of lines see it."""

import numpy as np
from jaxtyping import Float, Int

from ...estimation.kernels import innovation_rows, turn_halfway
from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import gain_of, squared_distance, whitening


@compiled
def pair_distances(
    e: Float[np.ndarray, "c 2"],
    H_pose: Float[np.ndarray, "c 2 3"],
    H_line: Float[np.ndarray, "c 2 2"],
    R: Float[np.ndarray, "c 2 2"],
    line: Int[np.ndarray, " c"],
    cov: Float[np.ndarray, "t t"],
) -> Float[np.ndarray, " c"]:
    """Return the squared Mahalanobis distance of each pair, from the joint covariance of pose and line."""
    d2 = np.empty(len(line))
    S = np.empty((2, 2))
    for c in range(len(line)):
        at = 3 + 2 * line[c]
        for i in range(2):
            for j in range(2):
                S[i, j] = R[c, i, j]
                for a in range(3):
                    for b in range(3):
                        S[i, j] += H_pose[c, i, a] * cov[a, b] * H_pose[c, j, b]
                    for b in range(2):
                        cross = H_pose[c, i, a] * H_line[c, j, b] + H_pose[c, j, a] * H_line[c, i, b]
                        S[i, j] += cross * cov[a, at + b]
                for a in range(2):
                    for b in range(2):
                        S[i, j] += H_line[c, i, a] * cov[at + a, at + b] * H_line[c, j, b]
        d2[c] = squared_distance(e[c, 0], e[c, 1], S[0, 0], S[0, 1], S[1, 1])
    return d2


@compiled
def taken_together(
    cov: Float[np.ndarray, "t t"],
    line: Int[np.ndarray, " m"],
    H_pose: Float[np.ndarray, "m 2 3"],
    H_line: Float[np.ndarray, "m 2 2"],
    R: Float[np.ndarray, "m 2 2"],
) -> tuple[Float[np.ndarray, "t k"], Float[np.ndarray, "k k"]]:
    """Return P H' and H P H' + R of m observations of lines, k = 2 m; several may be of one line."""
    m = len(line)
    PHt, S = np.empty((len(cov), 2 * m)), np.empty((2 * m, 2 * m))
    for row in range(len(cov)):
        for k in range(m):
            at = 3 + 2 * line[k]
            for i in range(2):
                by_pose = 0.0
                for a in range(3):
                    by_pose += cov[row, a] * H_pose[k, i, a]
                by_line = cov[row, at] * H_line[k, i, 0] + cov[row, at + 1] * H_line[k, i, 1]
                PHt[row, 2 * k + i] = by_pose + by_line
    for k in range(m):
        at = 3 + 2 * line[k]
        for i in range(2):
            for other in range(2 * m):
                by_pose = 0.0
                for a in range(3):
                    by_pose += H_pose[k, i, a] * PHt[a, other]
                by_line = H_line[k, i, 0] * PHt[at, other] + H_line[k, i, 1] * PHt[at + 1, other]
                S[2 * k + i, other] = by_pose + by_line
            for j in range(2):
                S[2 * k + i, 2 * k + j] += R[k, i, j]
    return PHt, S


@compiled
def seen_halfway(
    mean: Float[np.ndarray, " t"],
    cov: Float[np.ndarray, "t t"],
    anchors: Float[np.ndarray, "n 2"],
    line: Int[np.ndarray, " m"],
    lines: Float[np.ndarray, "m 2"],
    lines_cov: Float[np.ndarray, "m 2 2"],
) -> tuple[
    Float[np.ndarray, " k"],
    Float[np.ndarray, "k 3"],
    Float[np.ndarray, "t k"],
    Float[np.ndarray, "k k"],
    Float[np.ndarray, "k k"],
]:
    """Return e, H_pose, P H', S and its W of seen lines, linearised halfway to where they put the pose."""
    means = mean[3:].reshape((-1, 2))[line]
    pose = mean[:3]
    e, H_pose, H_line, R = innovation_rows(pose, anchors[line], means, lines, lines_cov, pose[:2], means[:, 0].copy())
    PHt, S = taken_together(cov, line, H_pose, H_line, R)
    W, turn = whitening(S), np.zeros(len(line))
    of_heading, of_lines = gain_of(PHt[2:3], W)[0], gain_of(PHt[3 + 2 * line], W)
    for k in range(len(line)):
        for i in range(2 * len(line)):
            turn[k] += (of_lines[k, i] - of_heading[i]) * e[i // 2, i % 2]
    turn_halfway(e, H_pose, H_line, lines, lines_cov, turn)
    PHt, S = taken_together(cov, line, H_pose, H_line, R)
    return e.ravel(), H_pose.reshape((-1, 3)), PHt, S, whitening(S)
