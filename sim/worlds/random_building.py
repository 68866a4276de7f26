"""Random buildings, `random:SEED`: rooms, corridors, halls, pillars, slanted walls, always the same for one seed."""

import numpy as np
import shapely
from jaxtyping import Float

from ..chance import SEED_MAX
from .drawing import Drawing, WorldError, shorten
from .floor_plan import STYLES, floor_plan
from .furnishing import furnish

START_CLEARANCE_M = 0.4
"""Least distance from the start to all walls."""
OUTER_M = 0.3
"""Thickness of what surrounds the building."""


def read_seed(text: str) -> Drawing:
    """Return the building of a seed written in digits; raises WorldError for anything else."""
    digits = text if text.isascii() and text.isdecimal() else ""
    if not digits or len(digits) > 20 or int(digits) > SEED_MAX:
        raise WorldError(f"expected a seed from 0 to 2^64 - 1 as in random:7, found {shorten(text)}: choose another")
    return random_building(int(digits))


def random_building(seed: int) -> Drawing:
    """Return a building drawn as one solid around its floor, turned by any angle, with a start pose somewhere on it."""
    chance = np.random.default_rng(seed)
    style = STYLES[int(chance.integers(len(STYLES)))]
    plan = floor_plan(style, chance)
    floor = furnish(plan, style.furniture * chance.uniform(0.0, 2.0), chance)
    start = _start(floor, chance)
    turn = chance.uniform(0.0, 2.0 * np.pi)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    # The start is the world's origin.
    floor = shapely.transform(floor, lambda at: (at - start) @ rotation)
    solid = floor.exterior.convex_hull.buffer(OUTER_M, join_style="mitre").difference(floor)
    heading = chance.uniform(-np.pi, np.pi)
    return Drawing(solids=tuple(shapely.get_parts(solid)), start=np.array([0.0, 0.0, heading]))


def _start(floor: shapely.Polygon, chance: np.random.Generator) -> Float[np.ndarray, "2"]:
    """Return a place on the floor that is clear of all walls, any one as likely as another."""
    roomy = floor.buffer(-1.05 * START_CLEARANCE_M)
    x0, y0, x1, y1 = roomy.bounds
    while True:
        at = np.array([chance.uniform(x0, x1), chance.uniform(y0, y1)])
        if shapely.contains_xy(roomy, *at):
            return at
