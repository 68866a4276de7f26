"""The factor graph that solves the whole problem once more at the end."""

import numpy as np
from jaxtyping import Float

from .graph import Graph
from .isam import Isam, lines_of, poses_of

ROUNDS = 10
"""Largest number of optima, each with the noise that the observations have at the one before."""


class GraphBatch(Graph):
    """As `Graph` step by step; `finish` then finds the least-squares optimum of everything."""

    def finish(self) -> Float[np.ndarray, "n 3"]:
        """Optimise all poses and lines together and return the smoothed trajectory, as `trajectory` does.

        The beliefs that follow are those of the optimum; the mission may go on from here.
        """
        values, count = self._all_entered().values(), self._isam.last + 1
        for _ in range(ROUNDS):
            poses = poses_of(values, count)
            self.record.weigh(poses, lines_of(values, list(self.record.lines)))
            values = Isam(self.config, self.record, values).optimum()
            if np.allclose(poses_of(values, count), poses, rtol=0, atol=1e-9):
                break
        self._start_from(values)
        return self.trajectory()
