"""Which places lie near the walls of the map that are trusted."""

import numpy as np
import shapely
from jaxtyping import Bool, Float

from chainslam.slam.map.stochastic_map import StochasticMap


class TrustedWalls:
    """The walls of a map that were seen often enough, as they are now."""

    def __init__(self, walls: StochasticMap) -> None:
        """Take the walls that are not tentative."""
        self._tree = shapely.STRtree(shapely.linestrings(walls.ends_world[~walls.tentative]))

    def near(self, places_world: Float[np.ndarray, "n 2"], reach_m: float) -> Bool[np.ndarray, " n"]:
        """Return which places lie within reach of a wall."""
        found = np.zeros(len(places_world), dtype=bool)
        found[self._tree.query(shapely.points(places_world), predicate="dwithin", distance=reach_m)[0]] = True
        return found
