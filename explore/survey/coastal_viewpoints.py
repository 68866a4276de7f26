"""From where unseen floor amid a hall is seen with walls in sight: beyond these only the odometry tells the way."""

import numpy as np
from jaxtyping import Float

from ..floor.free_space import FreeSpace
from ..planning.driving_field import DrivingField
from ..planning.sight import sees
from .trusted_walls import TrustedWalls

DISTANCES = 6
"""From so many distances up to the farthest."""
NEARLY_M = 0.3
"""Of the places that see a piece of border, those not farther from it than the nearest and this much."""


def coastal_viewpoints(
    place_world: Float[np.ndarray, "2"],
    walls: TrustedWalls,
    coast_m: float,
    reach_m: float,
    free_space: FreeSpace,
    field: DrivingField,
    *,
    only_near: bool = False,
) -> Float[np.ndarray, "m 2"]:
    """Return where the robot can stand within `coast_m` of a wall to see a place from within `reach_m`, m.

    `only_near` as in `DrivingField.can_stay`.
    """
    rings = reach_m * np.arange(1, DISTANCES + 1) / DISTANCES
    spots = field.stands_around(place_world[None], rings, only_near=only_near)
    spots = spots[walls.near(spots, coast_m)]
    spots = spots[sees(free_space, spots, place_world, short_m=0.0)]
    away = np.hypot(*(spots - place_world).T)
    return spots[away <= away.min(initial=np.inf) + NEARLY_M]
