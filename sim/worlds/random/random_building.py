"""Random buildings, `random:SEED`: rooms, corridors, halls, pillars, slanted walls, always the same for one seed."""

import numpy as np
import shapely
from jaxtyping import Float

from ...chance import SEED_MAX
from ..drawing import Drawing, WorldError, shorten
from .floor_plan import STYLES, floor_plan
from .furnishing import furnish

START_CLEARANCE_M = 0.4
"""Smallest distance of the start from all walls."""
LEAST_FACE_M = 0.0999
"""Smallest length of a face: the thickness of a wall, 0.1 m, less rounding."""
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
    floor = _floor(chance)
    start = _start(floor, chance)
    turn = chance.uniform(0.0, 2.0 * np.pi)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    # The start is the world's origin.
    floor = shapely.transform(floor, lambda at: (at - start) @ rotation)
    solid = floor.exterior.convex_hull.buffer(OUTER_M, join_style="mitre").difference(floor)
    heading = chance.uniform(-np.pi, np.pi)
    return Drawing(
        solids=tuple(shapely.get_parts(solid)),
        start=np.array([0.0, 0.0, heading]),
        understood="generated at random",
        scale="in metres",
    )


def _floor(chance: np.random.Generator) -> shapely.Polygon:
    """Return a floor, drawn again if a door beside a slanted wall left a face shorter than the thickness of a wall."""
    while True:
        style = STYLES[int(chance.integers(len(STYLES)))]
        floor = furnish(floor_plan(style, chance), style.furniture * chance.uniform(0.0, 2.0), chance)
        if _shortest_face(floor) >= LEAST_FACE_M:
            return floor


def _shortest_face(floor: shapely.Polygon) -> float:
    rings = [shapely.get_coordinates(ring) for ring in (floor.exterior, *floor.interiors)]
    return float(min(np.hypot(*np.diff(ring, axis=0).T).min() for ring in rings))


def _start(floor: shapely.Polygon, chance: np.random.Generator) -> Float[np.ndarray, "2"]:
    """Return a uniformly random position on the floor that is clear of all walls."""
    roomy = floor.buffer(-1.05 * START_CLEARANCE_M)
    x0, y0, x1, y1 = roomy.bounds
    while True:
        at = np.array([chance.uniform(x0, x1), chance.uniform(y0, y1)])
        if shapely.contains_xy(roomy, *at):
            return at
