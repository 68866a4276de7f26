"""The error of a map after gauge alignment: a common rigid motion of all walls is removed exactly.

The pose of the whole map in the world is unobservable, so a map is judged by its shape. Relative to the robot's last
pose, the error of the shape is only correct to first order: with a final heading error of tens of degrees a good map
would seem inconsistent.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.evaluation.consistency import pose_errors
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import J, to_robot, wrap

ROUNDING = 1e-15
"""The search for the least error ends at a relative change of this."""


@dataclass(frozen=True)
class OwnGauge:
    """The error of some walls after gauge alignment."""

    squared: float
    """Squared error of the shape in units of its covariance: chi-square with `dof` degrees of freedom."""
    dof: int
    frame_world: Float[np.ndarray, "3"]
    """The motion (m, m, rad) about the world's origin that moves the true walls onto the map."""
    shift_m: float
    """Displacement of the middle of the walls by this motion."""
    frame_squared: float
    """Squared error of the frame in units of its covariance: 3 degrees of freedom."""

    @property
    def anees(self) -> float | None:
        """The squared error over its degrees of freedom; None for walls without a shape, such as a single one."""
        return self.squared / self.dof if self.dof > 0 else None


def own_gauge(
    means: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "s s"],
    anchors_world: Float[np.ndarray, "m 2"],
    true_lines_world: Float[np.ndarray, "m 2"],
) -> OwnGauge:
    """Return the error of walls (alpha rad, d m) about their anchors against the true lines (alpha rad, r m).

    `cov` (s = 2 m) is that of plain errors. The frame is the motion g that minimises e(g)' P^-1 e(g), without prior
    knowledge of it. Raises numpy.linalg.LinAlgError if P is not positive definite.
    """
    walls = (means, anchors_world, true_lines_world, np.linalg.inv(np.linalg.cholesky(cov)))
    turn = float(np.angle(np.mean(np.exp(1j * (means[:, 0] - true_lines_world[:, 0])))))
    start = np.array([0.0, 0.0, turn])
    by_shift = _by_motion(true_lines_world[:, 0] + turn, anchors_world, walls[-1])[:, :2]
    start[:2] = np.linalg.lstsq(by_shift, _off(start, *walls), rcond=None)[0]
    if len(means) > 1:
        start = _nearest_frame(start, *walls)
    frame = np.array([start[0], start[1], wrap(start[2])])
    error = _off(frame, *walls)
    rank = np.linalg.matrix_rank(_by_motion(true_lines_world[:, 0] + frame[2], anchors_world - frame[:2], walls[-1]))
    # The covariance must be evaluated at the estimated walls. Evaluating it at the true walls, only millimetres away,
    # would understate a heading uncertainty of 10 degrees by a factor of 200.
    xi = _by_motion(means[:, 0], anchors_world, walls[-1]) @ pose_errors(frame[None], np.zeros((1, 3)))[0]
    middle = anchors_world.mean(axis=0)
    shift_m = float(np.hypot(*(middle - to_robot(middle, frame))))
    return OwnGauge(float(error @ error), len(error) - int(rank), frame, shift_m, float(xi @ xi))


def _nearest_frame(
    start: Float[np.ndarray, "3"],
    means: Float[np.ndarray, "m 2"],
    anchors_world: Float[np.ndarray, "m 2"],
    true_lines_world: Float[np.ndarray, "m 2"],
    white: Float[np.ndarray, "s s"],
) -> Float[np.ndarray, "3"]:
    """Return the frame of least squared error; `white` is the inverse of the Cholesky factor of the covariance."""
    from scipy.optimize import least_squares  # 0.2 s to import, which only those who score need wait for.

    def by_frame(at: Float[np.ndarray, "3"]) -> Float[np.ndarray, "s 3"]:
        return -_by_motion(true_lines_world[:, 0] + at[2], anchors_world - at[:2], white)

    def off(at: Float[np.ndarray, "3"]) -> Float[np.ndarray, " s"]:
        return _off(at, means, anchors_world, true_lines_world, white)

    found = least_squares(off, start, by_frame, method="lm", x_scale="jac", ftol=ROUNDING, xtol=ROUNDING, gtol=ROUNDING)
    frame: np.ndarray = found.x
    return frame


def _off(
    frame_world: Float[np.ndarray, "3"],
    means: Float[np.ndarray, "m 2"],
    anchors_world: Float[np.ndarray, "m 2"],
    true_lines_world: Float[np.ndarray, "m 2"],
    white: Float[np.ndarray, "s s"],
) -> Float[np.ndarray, " s"]:
    """Return the whitened errors (s,) after the truth is moved by the frame."""
    alpha = true_lines_world[:, 0] + frame_world[2]
    n = normals(alpha)
    d = true_lines_world[:, 1] + n @ frame_world[:2] - np.vecdot(n, anchors_world)
    error = np.stack([wrap(means[:, 0] - alpha), means[:, 1] - d], axis=-1).ravel()
    return white @ error


def _by_motion(
    alpha_rad: Float[np.ndarray, " m"], arms_m: Float[np.ndarray, "m 2"], white: Float[np.ndarray, "s s"]
) -> Float[np.ndarray, "s 3"]:
    """Return how lines of these directions move, whitened, by a motion (x, y, turn) about the origin of the arms.

    An arm leads to where a line's d is told, in world axes.
    """
    n = normals(alpha_rad)
    by_motion = np.zeros((2 * len(n), 3))
    by_motion[0::2, 2] = 1.0
    by_motion[1::2, :2] = n
    by_motion[1::2, 2] = np.vecdot(n, arms_m @ J.T)
    return white @ by_motion
