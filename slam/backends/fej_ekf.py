"""First-estimates Jacobians: no information about where the world lies (docs/concepts/consistency.md)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import Observations
from ..estimation.models import Initialisation, Innovations, Motion, initialise, innovations, move
from ..robot import Odometry
from .kalman.dense_map import DenseMap
from .kalman.ekf import Ekf
from .kalman.linear import carry


class FejEkf(Ekf[DenseMap]):
    """The full filter with every Jacobian at first estimates: p as it was predicted, alpha as it was first seen."""

    new_map = DenseMap

    def _begin(self) -> None:
        super()._begin()
        self._position = self._map.pose_world[:2]
        self._alpha = np.zeros(0)
        """Direction of each line when it was first seen, in the order of the map's ids."""

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map."""
        self._alpha = np.delete(self._alpha, self.belief.rows(ids))
        super().remove(ids)

    def merge(self, keep: int, drop: int) -> None:
        """Condition the map on `keep` and `drop` being one line, then forget `drop`."""
        row = self.belief.rows([keep, drop])[1]
        super().merge(keep, drop)
        self._alpha = np.delete(self._alpha, row)

    def _motion(self, odometry: Odometry) -> Motion:
        motion = move(self._map.pose_world, odometry.motion, self._position)
        self._position = motion.pose_world[:2]
        return motion

    def _innovations(
        self,
        rows: Int[np.ndarray, " m"],
        seen: Observations,
        pose_world: Float[np.ndarray, "3"],
        means: Float[np.ndarray, "m 2"],
    ) -> Innovations:
        """Compare observations with what a pose and lines predict, the Jacobian staying at the first estimates."""
        anchors, first = self._map.anchors[rows], self._alpha[rows]
        return innovations(pose_world, anchors, means, seen.lines, seen.cov, self._position, first)

    def _initialisation(self, lines: Float[np.ndarray, "m 2"], centres: Float[np.ndarray, "m 2"]) -> Initialisation:
        new = initialise(self._map.pose_world, lines, centres, self._config.at_wall, self._position)
        self._alpha = np.concatenate([self._alpha, new.means[:, 0]])
        return new

    def _align(self, rows: Int[np.ndarray, "2"]) -> float:
        """Turn the first direction of the line dropped to that of the line kept: else their equality says where."""
        turned = self._alpha.copy()
        turned[rows[1]] = turned[rows[0]]
        self._map.shear(*carry(self._position, self._position, self._alpha, turned, self._map.anchors))
        self._alpha = turned
        return float(turned[rows[0]])
