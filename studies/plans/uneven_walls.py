"""Buildings whose walls are not plane: steps, bends and pilasters of 10 to 60 mm."""

from dataclasses import replace

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.polygon import orient

from chainslam.sim.worlds import World

LONG_M = 1.2
"""Shorter faces stay plane."""
DEPTH_M = (0.01, 0.06)
"""How far a part of a face stands before or behind the rest, from and to; spread evenly in the logarithm. Of
what is read from a drawing, 12 mm and less are smoothed."""
PILASTER_M = (0.3, 1.0)
SHARE = 0.7
"""Of the long faces, so many are changed."""
LEFT_M = 0.3
"""So much of a face stays on each side of a step or a bend."""


def uneven(world: World, seed: int) -> World:
    """Return a world whose long faces have a step, bend or pilaster each, drawn by the seed and the world's name."""
    chance = np.random.default_rng([seed, *world.name.encode()])
    free = orient(world.free, 1.0)
    for a, b in world.faces:
        if np.hypot(*(b - a)) >= LONG_M and chance.uniform() < SHARE:
            inward = chance.uniform() < 0.5
            piece = _piece(a, b, inward, chance)
            changed = free.difference(piece) if inward else free.union(piece)
            changed = shapely.set_precision(changed, 1e-6).simplify(1e-5)
            if isinstance(changed, shapely.Polygon) and _is_whole(changed, free, world):
                free = orient(changed, 1.0)
    return replace(world, free=free)


def _piece(
    a: Float[np.ndarray, "2"], b: Float[np.ndarray, "2"], inward: bool, chance: np.random.Generator
) -> shapely.Polygon:
    """Return what is put before a face from a to b, or taken out behind it; the floor is on its left."""
    length = float(np.hypot(*(b - a)))
    along = (b - a) / length
    normal = np.array([-along[1], along[0]]) * (1.0 if inward else -1.0)
    depth = float(np.exp(chance.uniform(*np.log(DEPTH_M))))
    kind = chance.integers(3)
    at = chance.uniform(LEFT_M, length - LEFT_M)
    if kind == 0:
        return shapely.Polygon([a, a + at * along + depth * normal, b])
    end = length if kind == 1 else min(at + chance.uniform(*PILASTER_M), length)
    p, q = a + at * along, a + end * along
    return shapely.Polygon([p, q, q + depth * normal, p + depth * normal])


def _is_whole(changed: shapely.Polygon, free: shapely.Polygon, world: World) -> bool:
    as_many = changed.is_valid and len(changed.interiors) == len(free.interiors)
    return as_many and bool(changed.contains(shapely.Point(world.start[:2]).buffer(0.3)))
