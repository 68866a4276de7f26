"""Where a scan puts the robot: the point at which a new pose is linearised."""

import numpy as np
from jaxtyping import Float

from ...estimation.models import innovations
from ...geometry.poses import rotation


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
    turn = np.eye(3)
    turn[:2, :2] = rotation(predicted[2] - motion[2])
    cov = turn @ motion_cov @ turn.T
    model = innovations(predicted, np.zeros_like(lines), lines, seen, seen_cov)
    H, R = model.H_pose.reshape(-1, 3), np.diagonal(model.R, axis1=1, axis2=2).ravel()
    HP = H @ cov
    return np.asarray(predicted + HP.T @ np.linalg.solve(HP @ H.T + np.diag(R), model.e.ravel()))
