"""What the filters share: that two lines are one, as a measurement, and what P must follow when the estimate moves."""

import numpy as np
from jaxtyping import Float

from ...estimation.backend import POSE
from ...estimation.models import reanchor
from ...geometry.lines import normals
from ...geometry.poses import J, wrap


def equality(
    means: Float[np.ndarray, "2 2"], anchors: Float[np.ndarray, "2 2"], alpha: float | None = None
) -> tuple[Float[np.ndarray, "2 7"], Float[np.ndarray, "2"]]:
    """Return H and e of the measurement that two lines are one, the Jacobian taken at the direction `alpha`."""
    moved, D = reanchor(means[1], anchors[1], anchors[0], alpha)
    H = np.zeros((2, 7))
    H[:, 3:5], H[:, 5:] = np.eye(2), -D
    e = moved - means[0]
    e[0] = wrap(e[0])
    return H, e


def carry(
    position: Float[np.ndarray, "2"],
    moved: Float[np.ndarray, "2"],
    alpha: Float[np.ndarray, " n"],
    turned: Float[np.ndarray, " n"],
    anchors: Float[np.ndarray, "n 2"],
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "n 2 3"]]:
    """Return what D - I adds to the pose (3, 3) and to each line (n, 2, 3), both multiples of the pose's error.

    D takes the directions that no scan can observe from those at (position, alpha) to those at (moved, turned):
    dp += J (p+ - p-) d_theta and dd += (n+ - n-)·(dp - J (p- - c) d_theta).
    """
    by_pose, by_line = np.zeros((POSE, POSE)), np.zeros((len(alpha), 2, POSE))
    by_pose[:2, 2] = J @ (moved - position)
    dn = normals(turned) - normals(alpha)
    by_line[:, 1, :2] = dn
    by_line[:, 1, 2] = -np.vecdot(dn, (position - anchors) @ J.T)
    return by_pose, by_line
