"""Which open ends lie on something round, whose chain of short walls no look can close."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from slam.geometry.lines import directions, normals
from slam.geometry.quantities import Count, Distance, Size, Turn
from slam.map.chains import OpenEnd
from slam.map.stochastic_map import StochasticMap


@dataclass(frozen=True)
class RoundConfig:
    """When short walls are chords and tangents of one circle."""

    radius_m: Size = 1.0
    """Largest radius: what is larger shows walls that are long enough to be joined."""
    wall_m: Distance = 0.8
    """Longer walls are none of a circle's."""
    off_m: Distance = 0.02
    """A tangent passes no farther than this from the circle."""
    beside_m: Distance = 0.1
    """And it touches it no farther than this past its ends."""
    walls: Count = 4
    """So many walls must lie on it: any three do on some circle."""
    step_rad: Turn = float(np.deg2rad(60.0))
    """Neighbours on it turn by less than this: a box is no circle, though one touches all its faces."""


def is_round(end: OpenEnd, walls: StochasticMap, config: RoundConfig = RoundConfig()) -> bool:
    """Return whether the wall of an open end and others beside it touch one circle from outside."""
    row = int(walls.belief.rows([end.wall])[0])
    lengths = walls.extents[:, 1] - walls.extents[:, 0]
    if lengths[row] > config.wall_m:
        return False
    middles = walls.ends_world.mean(axis=1)
    near = np.hypot(*(middles - middles[row]).T) <= 2.0 * config.radius_m
    others = np.flatnonzero(near & (lengths <= config.wall_m))
    others = others[others != row]
    if len(others) < config.walls - 1:
        return False
    rows = np.array([row, *others])
    lines, half = walls.belief.lines_world[rows], 0.5 * lengths[rows]
    into, along = normals(lines[:, 0]), directions(lines[:, 0])
    circles = _circles(into, lines[:, 1])
    circles = circles[(circles[:, 2] > 0.0) & (circles[:, 2] <= config.radius_m)]
    if not len(circles):
        return False
    off = circles[:, :2] @ into.T - lines[:, 1] - circles[:, 2:]
    beside = np.abs(circles[:, :2] @ along.T - np.vecdot(along, middles[rows])) - half
    touches = (np.abs(off) <= config.off_m) & (beside <= config.beside_m)
    return any(_run(lines[on, 0], config) for on in touches if on[0])


def _circles(into: Float[np.ndarray, "n 2"], distances: Float[np.ndarray, " n"]) -> Float[np.ndarray, "k 3"]:
    """Return centre and radius, m, of the circles that the first line and two others touch from outside."""
    triples = np.array([(0, *pair) for pair in combinations(range(1, len(into)), 2)])
    rows = np.concatenate([into, -np.ones((len(into), 1))], axis=1)[triples]
    good = np.abs(np.linalg.det(rows)) > 1e-3
    return np.linalg.solve(rows[good], distances[triples[good]][..., None])[..., 0]


def _run(alphas: Float[np.ndarray, " n"], config: RoundConfig) -> bool:
    """Return whether enough directions, that of the first among them, follow each other in small steps."""
    turns = np.sort(np.mod(alphas - alphas[0] + np.pi, 2.0 * np.pi))
    run = np.split(turns, np.flatnonzero(np.diff(turns) > config.step_rad) + 1)
    return any(len(part) >= config.walls and part[0] <= np.pi <= part[-1] for part in run)
