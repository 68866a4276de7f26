"""The factor graph that solves the whole problem once more at the end."""

import numpy as np
from jaxtyping import Float

from .graph import Graph
from .isam import Isam, lines_of, poses_of


class GraphBatch(Graph):
    """As `Graph` step by step; `finish` then finds the least-squares optimum of everything."""

    def finish(self) -> Float[np.ndarray, "n 3"]:
        """Optimise all poses and lines together and return the smoothed trajectory, as `trajectory` does.

        The beliefs that follow are those of the optimum; the mission may go on from here.
        """
        values = self._all_entered().values()
        self.record.weigh(poses_of(values, self._isam.last + 1), lines_of(values, list(self.record.lines)))
        self._start_from(Isam(self.config, self.record, values).optimum())
        return self.trajectory()
