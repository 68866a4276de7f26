"""Buildings whose walls are not square: each face turned about its middle, or the whole building sheared."""

from dataclasses import replace

import numpy as np
import shapely
from jaxtyping import Float
from shapely.affinity import affine_transform
from shapely.geometry.polygon import orient

from chainslam.sim.worlds import World

from .moved_walls import LONG_M

PARALLEL = float(np.sin(np.deg2rad(10.0)))
PASSAGE_M = 0.3
"""Half the width that a passage keeps, at least."""


def with_turned(world: World, least_deg: float, most_deg: float) -> World:
    """Return a world in which long faces are turned by so much to either side, each by another angle.

    A face that cannot be turned without closing a passage or a wall stays.
    """
    chance = np.random.default_rng([int(1e3 * most_deg), *world.name.encode()])
    turns = np.deg2rad(chance.uniform(least_deg, most_deg, len(world.faces))) * chance.choice([-1, 1], len(world.faces))
    return _turned(world, turns)


def as_masons_do(world: World, sigma_deg: float) -> World:
    """Return a world of which the faces are square to within a standard deviation."""
    chance = np.random.default_rng([int(1e3 * sigma_deg), *world.name.encode()])
    return _turned(world, np.deg2rad(sigma_deg) * chance.standard_normal(len(world.faces)))


def sheared(world: World, degrees: float) -> World:
    """Return a world of which all right angles are off by so much, and parallels stay parallel."""
    lean = float(np.tan(np.deg2rad(degrees)))
    free = affine_transform(world.free, [1.0, lean, 0.0, 1.0, 0.0, 0.0])
    x, y, heading = world.start
    return replace(world, free=free, start=np.array([x + lean * y, y, heading]), labels={})


def _turned(world: World, turns: Float[np.ndarray, " n"]) -> World:
    """Return a world of which the faces that are long, and whose turn closes nothing, are turned by so much."""
    free, rings, least = world.free, _rings(world.free), _parts(world.free)
    k = 0
    for ring, points in enumerate(rings):
        for side in range(len(points)):
            changed = _with(rings, ring, side, float(turns[k % len(turns)]))
            k += 1
            if changed is None:
                continue
            tried = shapely.Polygon(changed[0], changed[1:])
            is_whole = tried.is_valid and tried.contains(shapely.Point(world.start[:2]).buffer(PASSAGE_M))
            if is_whole and _parts(tried) == least:
                rings, free = changed, tried
    return replace(world, free=shapely.set_precision(free, 1e-6), labels={})


def _rings(free: shapely.Polygon) -> list[Float[np.ndarray, "n 2"]]:
    whole = orient(free, 1.0).simplify(1e-5)
    return [shapely.get_coordinates(ring)[:-1] for ring in shapely.get_rings(whole)]


def _parts(free: shapely.Polygon) -> int:
    """Return into how many rooms the floor falls for a robot."""
    return len(shapely.get_parts(free.buffer(-PASSAGE_M)))


def _with(
    rings: list[Float[np.ndarray, "n 2"]], ring: int, side: int, turn: float
) -> list[Float[np.ndarray, "n 2"]] | None:
    """Return rings with one side turned; None where it is short, or meets its neighbours at a small angle."""
    points = rings[ring]
    n = len(points)
    a, b = points[side], points[(side + 1) % n]
    length = float(np.hypot(*(b - a)))
    if length < LONG_M:
        return None
    c, s = np.cos(turn), np.sin(turn)
    t, middle = np.array([[c, -s], [s, c]]) @ (b - a) / length, 0.5 * (a + b)
    moved = points.copy()
    for at, beside in ((side, (side - 1) % n), ((side + 1) % n, (side + 2) % n)):
        u = points[at] - points[beside]
        u = u / max(float(np.hypot(*u)), 1e-9)
        across = t[0] * u[1] - t[1] * u[0]
        if abs(across) < PARALLEL:
            return None
        moved[at] = middle + t * float((points[at] - middle)[0] * u[1] - (points[at] - middle)[1] * u[0]) / across
    return [*rings[:ring], moved, *rings[ring + 1 :]]
