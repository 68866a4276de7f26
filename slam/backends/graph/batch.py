"""The factor graph that solves the whole problem once more at the end."""

import numpy as np
from jaxtyping import Float

from .graph import Graph
from .optimum import optimise


class GraphBatch(Graph):
    """As `Graph` step by step; `finish` then finds the least-squares optimum of everything."""

    def finish(self) -> Float[np.ndarray, "n 3"]:
        """Optimise all poses and lines together and return the smoothed trajectory, as `trajectory` does.

        The beliefs that follow are those of the optimum; the mission may go on from here.
        """
        solver = self._all_entered()
        self._start_from(*optimise(self.config, self._record, solver.poses(), solver.all_lines()))
        return self.trajectory()
