"""Buildings with walls that were built elsewhere than they are drawn: single faces, moved along their normals."""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.polygon import orient

from chainslam.sim.worlds import World
from chainslam.slam.geometry.lines import normals, through

LONG_M = 0.8
"""Shorter faces stay."""
LEFT_M = 0.05
"""So much of the wall, and of the floor beside it, is left at least."""
SQUARE = float(np.sin(np.deg2rad(2.0)))
APART = 3
"""No two moved faces are nearer in their ring than this."""


@dataclass(frozen=True)
class Moved:
    """A face of a world that stands elsewhere in another."""

    face: int
    """Its row in `World.faces` of the drawing."""
    by_m: float
    """Along the normal of the face, which points from the floor into the wall."""


def with_moved(world: World, count: int, seed: int) -> tuple[World, tuple[Moved, ...]]:
    """Return a world in which up to so many faces stand 10 to 100 mm beside where they were."""
    chance = np.random.default_rng([seed, *world.name.encode()])
    free, moved = orient(world.free, 1.0), list[Moved]()
    for face in chance.permutation(len(world.faces)).tolist():
        if len(moved) == count:
            break
        by_m = float(np.exp(chance.uniform(np.log(0.01), np.log(0.1)))) * float(chance.choice([-1.0, 1.0]))
        near = any(
            world.face_rings[face] == world.face_rings[each.face] and abs(face - each.face) < APART for each in moved
        )
        for shift in () if near else (by_m, -by_m):
            if (changed := _with(world, free, face, shift)) is not None:
                free = orient(changed, 1.0)
                moved.append(Moved(face, shift))
                break
    return replace(world, free=free), tuple(moved)


def _with(world: World, free: shapely.Polygon, face: int, by_m: float) -> shapely.Polygon | None:
    """Return the floor with one face moved, None where that changes more than the face."""
    a, b = world.faces[face]
    n = normals(through(world.faces[face : face + 1])[:, 0])[0]
    length = float(np.hypot(*(b - a)))
    if length < LONG_M or not _is_square(free, a, b, n, abs(by_m) + LEFT_M):
        return None
    strip = shapely.Polygon([a, b, b + by_m * n, a + by_m * n])
    t = (b - a) / length
    reach = by_m + np.sign(by_m) * LEFT_M
    near, inner = 1e-4 * np.sign(by_m) * n, 1e-4 * t
    beyond = shapely.Polygon([a + near + inner, b + near - inner, b - inner + reach * n, a + inner + reach * n])
    if beyond.intersects(free.buffer(-1e-5)) if by_m > 0.0 else not free.buffer(1e-5).contains(beyond):
        return None
    changed = shapely.set_precision(free.union(strip) if by_m > 0.0 else free.difference(strip), 1e-6).simplify(1e-5)
    if not isinstance(changed, shapely.Polygon) or not changed.is_valid:
        return None
    is_whole = len(changed.interiors) == len(free.interiors)
    return changed if is_whole and changed.contains(shapely.Point(world.start[:2]).buffer(0.3)) else None


def _is_square(
    free: shapely.Polygon,
    a: Float[np.ndarray, "2"],
    b: Float[np.ndarray, "2"],
    n: Float[np.ndarray, "2"],
    least_m: float,
) -> bool:
    """Return whether both neighbours of a face of the floor stand square to it and are long enough to give way."""
    for ring in (free.exterior, *free.interiors):
        points = shapely.get_coordinates(ring)[:-1]
        at = np.flatnonzero(np.hypot(*(points - a).T) < 1e-5)
        if len(at) and np.hypot(*(points[(at[0] + 1) % len(points)] - b)) < 1e-5:
            sides = points[at[0] - 1] - a, points[(at[0] + 2) % len(points)] - b
            lengths = [float(np.hypot(*side)) for side in sides]
            along = [abs(n[0] * side[1] - n[1] * side[0]) / size for side, size in zip(sides, lengths, strict=True)]
            return min(lengths) > least_m and max(along) < SQUARE
    return False
