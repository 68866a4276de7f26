"""What stopped beams and is no wall of the map: an island that showed each scan too few beams for a line."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from chainslam.slam.map.stochastic_map import StochasticMap

from ..floor.free_space import FreeSpace
from ..planning.driving_field import DrivingField
from .frontiers import connected
from .trusted_walls import TrustedWalls

APART_M = 0.3
"""What stands this far from every wall of the map is none of them."""
TOGETHER_CELLS = 5.0
"""Cells hit this near to each other are one thing: from afar beams meet it some centimetres apart."""
LEAST_CELLS = 3
"""Fewer are single beams that ended on noise."""
LOOK_BEYOND_M = (0.4, 0.7)
"""With the body so far away, faces of a decimetre show beams enough."""


def unmapped_obstacles(free_space: FreeSpace, walls: StochasticMap) -> list[Float[np.ndarray, "n 2"]]:
    """Return what was hit and belongs to no wall of the map that is trusted, each as the cells' centres, m."""
    cells = np.argwhere((free_space.evidence > 0) & ~free_space.beyond)
    things = connected(cells[~TrustedWalls(walls).near(free_space.points(cells), APART_M)], TOGETHER_CELLS)
    return [free_space.points(thing) for thing in things if len(thing) >= LEAST_CELLS]


def obstacle_viewpoints(thing_world: Float[np.ndarray, "n 2"], field: DrivingField) -> Float[np.ndarray, "m 2"]:
    """Return where the robot can stand to look at a thing from nearby, m; the thing is given as points of it."""
    look_m = np.array([field.robot.beyond(metres) for metres in LOOK_BEYOND_M])
    places = field.stands_around(thing_world, look_m)
    return places[cKDTree(thing_world).query(places)[0] > look_m[0] - 1e-6]


def is_mapped(walls: StochasticMap, place_world: Float[np.ndarray, "2"]) -> bool:
    """Return whether a trusted wall of the map stands at a place."""
    return bool(TrustedWalls(walls).near(place_world[None], APART_M)[0])
