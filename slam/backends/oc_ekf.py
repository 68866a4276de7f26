"""The observability-constrained EKF: Jacobians at the estimate, and P changed least so that what is unseen stays so.

After Huang, Mourikis and Roumeliotis (2010) and Hesch et al. (2014), who prescribe the directions that no measurement
sees, N, and give the transition from one estimate to the next the least change that leads N over into itself. Here the
present estimates have their say in N, also of lines whose direction was off when they were first seen.
"""

import numpy as np
from jaxtyping import Float

from ..estimation.backend import POSE
from ..geometry.lines import normals
from ..geometry.numerics import LEAST_SIGMA
from ..geometry.poses import J
from .invariant_ekf import InvariantEkf, Point


class OcEkf(InvariantEkf):
    """The invariant filter but for how P is carried: by what all errors have in common, not by the pose's alone."""

    def _carry(self, before: Point, after: Point) -> None:
        """Carry P along: P <- D P D', D N = N+, D = I + (N+ - N) (N' W N)^-1 N' W nearest to I.

        W holds one over the variances, so that errors count in units of their sigmas.
        """
        unseen_before, unseen_after = (unseen(*point, self.map.anchors) for point in (before, after))
        variances = self.map.variances
        variances[:2] = variances[:2].mean()  # As they are in a world that is turned.
        weighted = unseen_before / np.maximum(variances, LEAST_SIGMA**2)[:, None]
        self.map.follow(unseen_after - unseen_before, np.linalg.solve(unseen_before.T @ weighted, weighted.T).T)


def unseen(
    position: Float[np.ndarray, "2"], alpha: Float[np.ndarray, " n"], anchors: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "s 3"]:
    """Return N: how a shift and a turn move pose and lines, s = 3 + 2 n (docs/concepts/consistency.md)."""
    N, n = np.zeros((POSE + 2 * len(alpha), 3)), normals(alpha)
    N[:POSE] = np.eye(POSE)
    N[:2, 2] = J @ position
    N[POSE::2, 2] = 1.0
    N[POSE + 1 :: 2, :2], N[POSE + 1 :: 2, 2] = n, np.vecdot(n, anchors @ J.T)
    return N
