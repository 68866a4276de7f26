"""Lanes: the floor beside each wall on which it is followed and its ends are rounded (paper, section 3.1)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import label

from chainslam.slam.geometry.lines import normals
from chainslam.slam.map.stochastic_map import StochasticMap

from .paths import Planner

STOP_M = 0.25
"""Along a lane, and round the ends of its wall, places from which another lane may be approached are so far apart."""


@dataclass(frozen=True, eq=False)
class Lane:
    """One piece of the floor beside a wall: what stands against the wall cuts its floor into several."""

    wall: int
    """Id of the wall."""
    cells: Int[np.ndarray, "n 2"]
    """(row, column) of the whole grid: the body fits there, and no wall stands between there and the wall."""
    stops_world: Float[np.ndarray, "k 2"]
    """Places along it, as near to the stand-off as there is a place, m."""


def lanes_of(wall: int, walls: StochasticMap, planner: Planner, standoff_m: float) -> list[Lane]:
    """Return the lanes of a wall, up to twice the stand-off from it, on its free side and round its ends."""
    row = walls.belief.rows([wall])[0]
    ends, into = walls.ends_world[row], normals(walls.belief.means[row, 0])
    reach_m = 2.0 * standoff_m
    first, cells = planner.passable_box(ends.min(axis=0) - reach_m, ends.max(axis=0) + reach_m)
    if not cells.size:
        return []
    places = planner.centres(first, cells.shape)
    length_m = float(np.hypot(*(ends[1] - ends[0])))
    along = (places - ends[0]) @ ((ends[1] - ends[0]) / max(length_m, 1e-9))
    behind = (places - ends[0]) @ into
    past = np.maximum(np.maximum(-along, along - length_m), 0.0)
    beside = (np.hypot(past, behind) <= reach_m) & ((behind < 0.0) | (past > 0.0))
    pieces, count = label(cells & beside, structure=np.ones((3, 3)))
    # Bins run along the wall and on round its ends.
    turn = np.arctan2(np.where(past > 0.0, past, 0.0), -behind)
    bins = np.round((along - np.sign(along) * past + np.sign(along) * standoff_m * turn) / STOP_M).astype(np.int64)
    off = np.abs(np.hypot(past, behind) - standoff_m)
    found = []
    for number in range(1, count + 1):
        at = np.nonzero(pieces == number)
        order = np.lexsort((off[at], bins[at]))
        _, nearest = np.unique(bins[at][order], return_index=True)
        found.append(Lane(wall, np.stack(at, axis=-1) + first, places[at][order[nearest]]))
    return found
