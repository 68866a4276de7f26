"""The paper's filter: relocation, then fusion, every cross-covariance neglected (sections 2.1, 2.2 and 4.1)."""

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Observations
from ...estimation.models import stack
from ..kalman.ekf import Ekf
from .block_map import BlockMap


class BlockEkf(Ekf[BlockMap]):
    """Moves the robot by the first matches, then fuses each line with its second match alone."""

    new_map = BlockMap

    def update(self, first: Observations, second: Observations) -> None:
        """Relocate by `first`, then fuse `second`; a line seen several times in the scan is fused several times."""
        moving, rest = self.belief.rows(first.ids), self.belief.rows(second.ids)
        if not len(moving) + len(rest):
            return
        self._move_on()
        if len(moving):
            self.map.relocate(stack(moving, self.compare(moving, first, self.map.pose_world, self.map.means[moving])))
        left = np.arange(len(rest))
        while len(left):
            rows, once = np.unique(rest[left], return_index=True)
            chosen = left[once]
            self._fuse(rows, Observations(second.ids[chosen], second.lines[chosen], second.cov[chosen]))
            left = np.delete(left, once)

    def _fuse(self, rows: Int[np.ndarray, " m"], seen: Observations) -> None:
        """Take the weighted mean of each line and what was seen of it, in model space: equations (2) and (3).

        x_2 = x_1 + H_line^-1 e is the observation in the map's frame, and its covariance C_2 has the robot's in it.
        """
        model = self.compare(rows, seen, self.map.pose_world, self.map.means[rows])
        to_line = np.linalg.inv(model.H_line)
        by_pose = model.H_pose @ self.map.pose_cov @ model.H_pose.swapaxes(1, 2)
        difference = (to_line @ model.e[..., None])[..., 0]
        C1, C2 = self.map.covs[rows], to_line @ (by_pose + model.R) @ to_line.swapaxes(1, 2)
        fused, moved = weighted_mean(C1, C2, difference)
        self.map.put(rows, self.map.means[rows] + moved, fused)


def weighted_mean(
    C1: Float[np.ndarray, "m 2 2"], C2: Float[np.ndarray, "m 2 2"], difference: Float[np.ndarray, "m 2"]
) -> tuple[Float[np.ndarray, "m 2 2"], Float[np.ndarray, "m 2"]]:
    """Return C_w = (C_1^-1 + C_2^-1)^-1 and x_w - x_1 = C_w C_2^-1 (x_2 - x_1), row by row.

    Written with the inverse of C_1 + C_2 alone, which always exists: C_w = C_1 (C_1 + C_2)^-1 C_2.
    """
    share = np.linalg.solve(C1 + C2, C1).swapaxes(1, 2)
    return share @ C2, (share @ difference[..., None])[..., 0]
