"""First-estimates Jacobians: no information about where the world lies (docs/concepts/consistency.md)."""

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
        self._position = self.map.pose_world[:2]
        self._alpha = np.zeros(0)
        """Direction of each line when it was first seen, in the order of the map's ids."""

    def forget(self, rows: Int[np.ndarray, " m"]) -> None:
        """Forget lines and their first directions."""
        self._alpha = np.delete(self._alpha, rows)
        super().forget(rows)

    def motion(self, odometry: Odometry) -> tuple[Motion, Float[np.ndarray, "3 3"]]:
        """Return the motion, its Jacobian from one predicted position to the next, and the noise that it adds."""
        motion = move(self.map.pose_world, odometry.motion, self._position)
        self._position = motion.pose_world[:2]
        return motion, motion.noise(odometry.cov)

    def compare(
        self,
        rows: Int[np.ndarray, " m"],
        seen: Observations,
        pose_world: Float[np.ndarray, "3"],
        means: Float[np.ndarray, "m 2"],
    ) -> Innovations:
        """Compare observations with what a pose and lines predict, the Jacobian staying at the first estimates."""
        anchors, first = self.map.anchors[rows], self._alpha[rows]
        return innovations(pose_world, anchors, means, seen.lines, seen.cov, self._position, first)

    def first_sight(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> tuple[Initialisation, Float[np.ndarray, "m 2 2"]]:
        """Return new lines as seen from the predicted position, and their noise."""
        new = initialise(self.map.pose_world, lines, centres, self.config.at_wall, self._position)
        self._alpha = np.concatenate([self._alpha, new.means[:, 0]])
        return new, new.noise(cov)

    def unite(self, rows: Int[np.ndarray, "2"]) -> None:
        """Turn the first direction of the line dropped to that of the line kept: else their equality says where."""
        turned = self._alpha.copy()
        turned[rows[1]] = turned[rows[0]]
        self.map.shear(*carry(self._position, self._position, self._alpha, turned, self.map.anchors))
        self._alpha = turned
        self._equate(rows, float(turned[rows[0]]))
