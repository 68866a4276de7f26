"""Buildings whose walls are not square: each wall turned about its middle, or the whole building sheared."""

from dataclasses import replace

import numpy as np
import shapely
from jaxtyping import Float, Int
from scipy.cluster.hierarchy import fcluster, linkage
from shapely.affinity import affine_transform
from shapely.geometry.polygon import orient

from chainslam.sim.worlds import World

THICK_M = 0.3
"""Faces whose lines are no farther apart are of one wall, or of walls in one line, and turn together."""
SQUARE = float(np.sin(np.deg2rad(1.0)))
"""Faces that are farther from the axes of the drawing stay."""
PASSAGE_M = 0.3
"""Half the width that a passage keeps, at least."""


def with_turned(world: World, least_deg: float, most_deg: float) -> World:
    """Return a world in which walls are turned by so much to either side, each by another angle.

    A wall that cannot be turned without closing a passage or opening another wall stays.
    """
    chance = _chance(world, most_deg)
    sizes, sides = chance.uniform(least_deg, most_deg, len(world.faces)), chance.choice([-1, 1], len(world.faces))
    return _turned(world, np.deg2rad(sizes * sides))


def as_masons_do(world: World, sigma_deg: float) -> World:
    """Return a world of which the walls are square to within a standard deviation."""
    return _turned(world, np.deg2rad(sigma_deg) * _chance(world, sigma_deg).standard_normal(len(world.faces)))


def sheared(world: World, degrees: float) -> World:
    """Return a world of which all right angles are off by so much, and parallels stay parallel."""
    lean = float(np.tan(np.deg2rad(degrees)))
    x, y, heading = world.start
    free = affine_transform(world.free, [1.0, lean, 0.0, 1.0, 0.0, 0.0])
    return replace(world, free=free, start=np.array([x + lean * y, y, heading]), labels={})


def _chance(world: World, degrees: float) -> np.random.Generator:
    return np.random.default_rng([int(1e3 * degrees), *world.name.encode()])


def _turned(world: World, turns: Float[np.ndarray, " w"]) -> World:
    """Return a world with its walls turned one by one, except for those whose turn closes or opens something."""
    whole = orient(world.free, 1.0).simplify(1e-5)
    rings = [shapely.get_coordinates(ring)[:-1] for ring in shapely.get_rings(whole)]
    starts = np.concatenate(rings)
    sides = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings])
    lengths = np.hypot(*sides.T)
    along, middles, walls = sides / lengths[:, None], starts + 0.5 * sides, _walls(starts, sides)
    free, rooms = world.free, _rooms(world.free)
    points, t = middles.copy(), along.copy()
    for wall, turn in zip(np.unique(walls[walls >= 0]), turns, strict=False):
        mine = walls == wall
        middle = np.average(middles[mine], axis=0, weights=lengths[mine])
        R = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        moved, turned = points.copy(), t.copy()
        moved[mine], turned[mine] = (middles[mine] - middle) @ R + middle, along[mine] @ R
        tried = _polygon(moved, turned, [len(ring) for ring in rings])
        start = shapely.Point(world.start[:2]).buffer(PASSAGE_M)
        if tried is not None and tried.contains(start) and _rooms(tried) == rooms:
            free, points, t = tried, moved, turned
    return replace(world, free=free, labels={})


def _walls(starts: Float[np.ndarray, "n 2"], sides: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, " n"]:
    """Return the wall that each side is a face of, -1 for sides that are oblique."""
    walls, next_wall = np.full(len(starts), -1), 0
    for axis in (0, 1):
        rows = np.flatnonzero(np.abs(sides[:, axis]) < SQUARE * np.hypot(*sides.T))
        if len(rows) > 1:
            labels = fcluster(linkage(starts[rows, axis : axis + 1]), THICK_M, "distance")
            walls[rows] = next_wall + labels
            next_wall += int(labels.max())
    return walls


def _rooms(free: shapely.Polygon) -> int:
    """Return into how many parts the floor falls for a robot."""
    return len(shapely.get_parts(free.buffer(-PASSAGE_M)))


def _polygon(
    points: Float[np.ndarray, "n 2"], along: Float[np.ndarray, "n 2"], sizes: list[int]
) -> shapely.Polygon | None:
    """Return the floor whose sides lie on lines, None if they do not cross in order."""
    rings, low = [], 0
    for size in sizes:
        here = np.arange(low, low + size)
        before = np.roll(here, 1)
        across = along[before, 0] * along[here, 1] - along[before, 1] * along[here, 0]
        if np.abs(across).min() < 0.1:
            return None
        gap = points[here] - points[before]
        share = (gap[:, 0] * along[here, 1] - gap[:, 1] * along[here, 0]) / across
        corners = points[before] + share[:, None] * along[before]
        if np.any(np.vecdot(np.roll(corners, -1, axis=0) - corners, along[here]) <= 0.0):
            return None
        rings.append(corners)
        low += size
    floor = shapely.set_precision(shapely.Polygon(rings[0], rings[1:]), 1e-6)
    if not isinstance(floor, shapely.Polygon) or not floor.is_valid or len(floor.interiors) != len(sizes) - 1:
        return None
    return orient(floor, 1.0)
