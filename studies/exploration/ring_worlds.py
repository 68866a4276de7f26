"""Rings of corridors around a block, to be explored: how long one is, where its niches are, and how it is turned."""

import numpy as np
import shapely
from shapely.affinity import rotate

from chainslam.experiments.replays.corridor import HALF_WIDTH_M, NICHE_M, PIECE_M
from chainslam.sim.worlds import World

LEAST_M = 24.0
"""Circumference of the smallest ring that has a block in it."""


def ring_world(length_m: float, seed: int) -> World:
    """Return a square ring of this circumference along its middle; raises ValueError below `LEAST_M`.

    Both walls have niches, drawn with `seed`; the robot starts in the middle of a side, along it.
    """
    if length_m < LEAST_M:
        raise ValueError(f"expected a ring of {LEAST_M:g} m or more, found {length_m:g}")
    rng = np.random.default_rng([seed, 3])
    half = length_m / 8.0
    outer, inner = half + HALF_WIDTH_M, half - HALF_WIDTH_M
    free = shapely.box(-outer, -outer, outer, outer) - shapely.box(-inner, -inner, inner, inner)
    niches = []
    for turn in range(4):
        for low, high, reach in ((-outer - NICHE_M, -outer, outer), (-inner, -inner + NICHE_M, inner)):
            cuts = -reach + np.cumsum(rng.uniform(*PIECE_M, int(2.0 * reach / PIECE_M[0]) + 2))
            cuts = cuts[cuts < reach - 1.0]
            # Each second piece is set back; none reaches round a corner.
            for begin, end in zip(cuts[:-1:2].tolist(), cuts[1::2].tolist(), strict=False):
                niches.append(rotate(shapely.box(begin, low, end, high), 90.0 * turn, origin=(0.0, 0.0)))
    angle, heading = rng.uniform(0.0, 2.0 * np.pi), rng.choice([0.0, np.pi])
    start = np.array([np.sin(angle), -np.cos(angle)]) * half
    turned = rotate(shapely.union_all([free, *niches]), angle, origin=(0.0, 0.0), use_radians=True)
    # The free side is on the left of every edge: the outline runs counter-clockwise, the block's the other way.
    drawn = shapely.orient_polygons(shapely.set_precision(turned, 1e-6))
    assert isinstance(drawn, shapely.Polygon), "expected one ring"
    return World(f"ring-{length_m:g}-{seed}", drawn, np.append(start, angle + heading), {})
