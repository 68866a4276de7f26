"""From where unseen floor amid a hall is looked at with walls in sight: beyond these only the wheels tell the way."""

import numpy as np
from jaxtyping import Bool, Float

from slam.geometry.lines import distance_to_segments
from slam.stochastic_map import StochasticMap

from .driving_field import DrivingField
from .free_space import FreeSpace
from .paths import sees

TILE_M = 1.5
"""A long border is looked at piece by piece."""
DIRECTIONS = 16
DISTANCES = 6
NEARLY_M = 0.3
"""Of the places that see a piece of border, those not farther from it than the nearest and this much."""


def on_coast(points_world: Float[np.ndarray, "n 2"], walls: StochasticMap, coast_m: float) -> Bool[np.ndarray, " n"]:
    """Return which points lie within `coast_m` of a trusted wall of the map."""
    trusted = walls.ends_world[~walls.tentative]
    if not len(trusted):
        return np.zeros(len(points_world), dtype=bool)
    return np.asarray(distance_to_segments(points_world, trusted).min(axis=1) <= coast_m)


def tiles(points_world: Float[np.ndarray, "n 2"]) -> list[Float[np.ndarray, "m 2"]]:
    """Return points in groups, each within a square of `TILE_M`."""
    _, group = np.unique(np.floor(points_world / TILE_M).astype(np.int64), axis=0, return_inverse=True)
    order = np.argsort(group.ravel(), kind="stable")
    return np.split(points_world[order], np.cumsum(np.bincount(group.ravel()))[:-1])


def look_outs_on_coast(
    border_world: Float[np.ndarray, "n 2"],
    walls: StochasticMap,
    coast_m: float,
    reach_m: float,
    free_space: FreeSpace,
    field: DrivingField,
) -> Float[np.ndarray, "m 2"]:
    """Return where the robot can stand within `coast_m` of a wall to see a piece of border within `reach_m`, m."""
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    metres = reach_m * np.arange(1, DISTANCES + 1) / DISTANCES
    middle = border_world.mean(axis=0)
    around = metres[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    places = (middle + around).reshape(-1, 2)
    cells = free_space.cells(places)
    places, cells = places[free_space.inside(cells)], cells[free_space.inside(cells)]
    places = places[field.can_stay(cells)]
    places = places[on_coast(places, walls, coast_m)]
    places = places[sees(free_space, places, middle, short_m=0.0)]
    away = np.hypot(*(places - middle).T)
    return places[away <= away.min(initial=np.inf) + NEARLY_M]
