"""Where a wall bends: two walls whose lines cross, and which both reach past the crossing, end there.

A scan from afar shows one line over a slight bend. Whichever of the two walls it is matched to then reaches past the
bend, beside the other, and no beam ever passes through it to show that it ends before. But of two faces that cross, one
hides the other.
"""

import numpy as np
from jaxtyping import Float, Int

from ..estimation.shared import SharedConfig
from ..geometry.lines import directions
from .kernels.bend_kernels import overlapping
from .merging import same_line
from .stochastic_map import StochasticMap


def ends_at_bends(
    walls: StochasticMap, range_m: float, one_wall: float, shared: SharedConfig
) -> tuple[Int[np.ndarray, "k 2"], Float[np.ndarray, "k 2"]]:
    """Return the pairs of ids of established walls that meet at a bend, and how far along each it is, from its anchor.

    Only walls within the scanner's range, m, are looked at. Two that may be one line by the chi-square gate at the
    probability level `one_wall` meet nowhere: they are left to be merged. The wall that runs up to the bend is first.
    """
    near = (walls.established & ~walls.tentative & (walls.distances_m < range_m)).nonzero()[0]
    belief, bounds = walls.belief, (float(shared.resolution_m), float(shared.sharp_rad))
    rows, points_world = overlapping(near, belief.means, walls.ends_world, *bounds)
    if not len(rows):
        return rows, points_world
    some = np.unique(rows)
    joint = belief.joint(walls.ids[some])
    differ = [not same_line(joint.take(pair), one_wall) for pair in np.searchsorted(some, rows)]
    rows, points_world = rows[differ], points_world[differ]
    along = np.vecdot(points_world[:, None] - belief.anchors[rows], directions(belief.means[rows, 0]))
    return walls.ids[rows], along
