"""How seen lines differ from lines of a map, row by row: the loops of `models`."""

import math

import numpy as np
from jaxtyping import Float, Int

from ..geometry.compiled import compiled
from ..geometry.matrix_kernels import wrapped

Rows = tuple[
    Float[np.ndarray, "m 2"], Float[np.ndarray, "m 2 3"], Float[np.ndarray, "m 2 2"], Float[np.ndarray, "m 2 2"]
]


@compiled
def along(r: float, t0: float, epsilon: float) -> float:
    """Return where the centre of a seen piece lies along a line turned by `epsilon` from it."""
    return r * math.sin(epsilon) + t0 * math.cos(epsilon)


@compiled
def innovation_rows(
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "m 2"],
    means: Float[np.ndarray, "m 2"],
    lines: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "m 2 2"],
    position: Float[np.ndarray, "2"],
    alpha: Float[np.ndarray, " m"],
) -> Rows:
    """Return e, H_pose, H_line and R of `models.innovations`, H taken at `position` and `alpha`."""
    m = len(lines)
    e, H_pose, H_line, R = np.empty((m, 2)), np.zeros((m, 2, 3)), np.zeros((m, 2, 2)), np.zeros((m, 2, 2))
    for k in range(m):
        epsilon = wrapped(lines[k, 0] - (means[k, 0] - pose_world[2]))
        t0, r = cov[k, 0, 1] / cov[k, 0, 0], lines[k, 1]
        cosine, sine = math.cos(epsilon), math.sin(epsilon)
        to_robot = math.cos(means[k, 0]) * (anchors[k, 0] - pose_world[0])
        to_robot += math.sin(means[k, 0]) * (anchors[k, 1] - pose_world[1])
        e[k, 0] = epsilon
        e[k, 1] = r * cosine - t0 * sine - (means[k, 1] + to_robot)
        nx, ny = math.cos(alpha[k]), math.sin(alpha[k])
        here = along(r, t0, wrapped(lines[k, 0] - (alpha[k] - pose_world[2])))
        H_pose[k, 0, 2] = -1.0
        H_pose[k, 1, 0], H_pose[k, 1, 1], H_pose[k, 1, 2] = -nx, -ny, here
        H_line[k, 0, 0] = H_line[k, 1, 1] = 1.0
        H_line[k, 1, 0] = nx * (anchors[k, 1] - position[1]) - ny * (anchors[k, 0] - position[0]) - here
        R[k, 0, 0] = cov[k, 0, 0]
        R[k, 1, 1] = (cov[k, 1, 1] - cov[k, 0, 1] * t0) * (cosine - t0 * sine / r) ** 2
    return e, H_pose, H_line, R


@compiled
def turn_halfway(
    e: Float[np.ndarray, "m 2"],
    H_pose: Float[np.ndarray, "m 2 3"],
    H_line: Float[np.ndarray, "m 2 2"],
    lines: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "m 2 2"],
    turn: Float[np.ndarray, " m"],
) -> None:
    """Take H, in place, halfway to where the heading makes up for `turn` of epsilon (`models.halfway`)."""
    for k in range(len(e)):
        less = along(lines[k, 1], cov[k, 0, 1] / cov[k, 0, 0], e[k, 0] - 0.5 * turn[k]) - H_pose[k, 1, 2]
        H_pose[k, 1, 2] += less
        H_line[k, 1, 0] -= less


@compiled
def stacked(
    place: Int[np.ndarray, " m"],
    count: int,
    H_pose: Float[np.ndarray, "m 2 3"],
    H_line: Float[np.ndarray, "m 2 2"],
    R: Float[np.ndarray, "m 2 2"],
) -> tuple[Float[np.ndarray, "k s"], Float[np.ndarray, "k k"]]:
    """Return H by the pose and `count` lines, and R, of m observations together; that of row m is of line `place[m]`.

    k = 2 m, s = 3 + 2 `count`.
    """
    m = len(place)
    H, noise = np.zeros((2 * m, 3 + 2 * count)), np.zeros((2 * m, 2 * m))
    for k in range(m):
        for i in range(2):
            for j in range(3):
                H[2 * k + i, j] = H_pose[k, i, j]
            for j in range(2):
                H[2 * k + i, 3 + 2 * place[k] + j] = H_line[k, i, j]
                noise[2 * k + i, 2 * k + j] = R[k, i, j]
    return H, noise
