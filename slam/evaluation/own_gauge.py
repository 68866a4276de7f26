"""How wrong a map is in itself: a common shift and turn of all its walls is taken out exactly.

No scan can tell where the world lies, so what a map knows is its shape. Told against the robot's last pose the shape's
error is right to first order only: a robot that ends lost by tens of degrees makes a good map look hopeless.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..geometry.lines import normals
from ..geometry.poses import J, to_robot, wrap
from .consistency import pose_errors

DAMPING_MAX = 1e6
"""With so much damping, in units of the squared columns, no step is long enough to make the error less: it is least."""


@dataclass(frozen=True)
class OwnGauge:
    """The error of some walls, apart from where their frame lies."""

    squared: float
    """Squared error of the shape in units of its covariance: chi-square with `dof` degrees of freedom."""
    dof: int
    frame_world: Float[np.ndarray, "3"]
    """The motion (m, m, rad) about the world's origin that carries the true walls onto the map."""
    shift_m: float
    """How far it carries the middle of the walls."""
    frame_squared: float
    """Squared error of the frame in units of its covariance: 3 degrees of freedom."""

    @property
    def anees(self) -> float | None:
        """The squared error over its degrees of freedom; None for walls that have no shape, as a lone one."""
        return self.squared / self.dof if self.dof > 0 else None


def own_gauge(
    means: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "s s"],
    anchors_world: Float[np.ndarray, "m 2"],
    true_lines_world: Float[np.ndarray, "m 2"],
) -> OwnGauge:
    """Return the error of walls (alpha rad, d m) about their anchors against the true lines (alpha rad, r m).

    `cov` (s = 2 m) is that of plain errors. The frame is the motion g that makes e(g)' P^-1 e(g) least, as if nothing
    were known of it beforehand. Raises numpy.linalg.LinAlgError where P is not positive definite.
    """
    walls = (means, anchors_world, true_lines_world, np.linalg.inv(np.linalg.cholesky(cov)))
    turn = float(np.angle(np.mean(np.exp(1j * (means[:, 0] - true_lines_world[:, 0])))))
    start = np.array([0.0, 0.0, turn])
    start[:2] = np.linalg.lstsq(_by_frame(start, *walls)[:, :2], _off(start, *walls), rcond=None)[0]
    if len(means) > 1:
        start = _nearest_frame(start, *walls)
    frame = np.array([start[0], start[1], wrap(start[2])])
    error, by_frame = _off(frame, *walls), _by_frame(frame, *walls)
    about_origin = by_frame.copy()
    about_origin[:, 2] += by_frame[:, :2] @ (J @ frame[:2])  # a further turn of the world carries the shift along
    xi = about_origin @ pose_errors(frame[None], np.zeros((1, 3)))[0]
    rank = int(np.linalg.matrix_rank(by_frame))
    middle = anchors_world.mean(axis=0)
    shift_m = float(np.hypot(*(middle - to_robot(middle, frame))))
    return OwnGauge(float(error @ error), len(error) - rank, frame, shift_m, float(xi @ xi))


def _nearest_frame(
    start: Float[np.ndarray, "3"],
    means: Float[np.ndarray, "m 2"],
    anchors_world: Float[np.ndarray, "m 2"],
    true_lines_world: Float[np.ndarray, "m 2"],
    white: Float[np.ndarray, "s s"],
) -> Float[np.ndarray, "3"]:
    """Return the frame of least squared error: Levenberg and Marquardt, damped by the size of each column.

    `white` is the inverse of the Cholesky factor of the covariance. scipy.optimize takes 0.2 s to import.
    """
    walls = (means, anchors_world, true_lines_world, white)
    at, error, damping = start, _off(start, *walls), 1e-3
    while damping < DAMPING_MAX:
        by_frame = _by_frame(at, *walls)
        damped = np.vstack([by_frame, np.diag(np.sqrt(damping) * np.linalg.norm(by_frame, axis=0))])
        step = np.linalg.lstsq(damped, np.append(error, np.zeros(3)), rcond=None)[0]
        new = _off(at + step, *walls)
        if new @ new >= error @ error:
            damping *= 10.0
            continue
        at, error, damping = at + step, new, 0.1 * damping
    return at


def _off(
    frame_world: Float[np.ndarray, "3"],
    means: Float[np.ndarray, "m 2"],
    anchors_world: Float[np.ndarray, "m 2"],
    true_lines_world: Float[np.ndarray, "m 2"],
    white: Float[np.ndarray, "s s"],
) -> Float[np.ndarray, " s"]:
    """Return the whitened errors (s,) once the truth is moved by the frame."""
    alpha = true_lines_world[:, 0] + frame_world[2]
    n = normals(alpha)
    d = true_lines_world[:, 1] + n @ frame_world[:2] - np.vecdot(n, anchors_world)
    error = np.stack([wrap(means[:, 0] - alpha), means[:, 1] - d], axis=-1).ravel()
    return white @ error


def _by_frame(
    frame_world: Float[np.ndarray, "3"],
    means: Float[np.ndarray, "m 2"],
    anchors_world: Float[np.ndarray, "m 2"],
    true_lines_world: Float[np.ndarray, "m 2"],
    white: Float[np.ndarray, "s s"],
) -> Float[np.ndarray, "s 3"]:
    """Return how the truth moves, whitened, as a coordinate (x, y, turn) of the frame grows."""
    n = normals(true_lines_world[:, 0] + frame_world[2])
    by_frame = np.zeros((2 * len(means), 3))
    by_frame[0::2, 2] = 1.0
    by_frame[1::2, :2] = n
    by_frame[1::2, 2] = np.vecdot(n, (anchors_world - frame_world[:2]) @ J.T)
    return white @ by_frame
