"""Round things: short walls that are chords and tangents of one circle, and how far such a wall is from its arc."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from .lines import directions, normals
from .quantities import Count, Distance, Size, Turn


@dataclass(frozen=True)
class RoundConfig:
    """When short walls count as chords and tangents of one curved obstacle."""

    radius_m: Size = 1.0
    """Largest radius of a curved obstacle."""
    wall_m: Distance = 0.8
    """Longest wall that can be part of a curved obstacle."""
    off_m: Distance = 0.02
    """Largest distance between the line of such a wall and the circle."""
    beside_m: Distance = 0.1
    """How far past an end of such a wall the circle may touch its line."""
    walls: Count = 4
    """Smallest number of walls on one circle."""
    step_rad: Turn = float(np.deg2rad(60.0))
    """Largest turn between neighbouring walls on the circle, so that a box does not count as one."""


DEFAULT = RoundConfig()


def radius_of(
    row: int, lines_world: Float[np.ndarray, "n 2"], ends_world: Float[np.ndarray, "n 2 2"], config: RoundConfig
) -> float:
    """Return the radius m of the circle that a wall and most others beside it touch from outside; 0 for none."""
    lengths = np.hypot(*(ends_world[:, 1] - ends_world[:, 0]).T)
    if lengths[row] > config.wall_m:
        return 0.0
    middles = ends_world.mean(axis=1)
    near = np.hypot(*(middles - middles[row]).T) <= 2.0 * config.radius_m
    others = np.flatnonzero(near & (lengths <= config.wall_m))
    others = others[others != row]
    if len(others) < config.walls - 1:
        return 0.0
    rows = np.array([row, *others])
    lines, half = lines_world[rows], 0.5 * lengths[rows]
    into, along = normals(lines[:, 0]), directions(lines[:, 0])
    circles = _circles(into, lines[:, 1])
    circles = circles[(circles[:, 2] > 0.0) & (circles[:, 2] <= config.radius_m)]
    if not len(circles):
        return 0.0
    off = circles[:, :2] @ into.T - lines[:, 1] - circles[:, 2:]
    beside = np.abs(circles[:, :2] @ along.T - np.vecdot(along, middles[rows])) - half
    touches = (np.abs(off) <= config.off_m) & (beside <= config.beside_m)
    found = [(np.count_nonzero(on), k) for k, on in enumerate(touches) if on[0] and _run(lines[on, 0], config)]
    return float(circles[max(found)[1], 2]) if found else 0.0


def cov_of_rounding(
    lines_world: Float[np.ndarray, "n 2"], ends_world: Float[np.ndarray, "n 2 2"], config: RoundConfig = DEFAULT
) -> Float[np.ndarray, "n 2 2"]:
    """Return what the covariances of (alpha, d) of walls lack where they are round; zero for all others.

    A wall of length L on a circle of radius R stands for an arc up to t = asin(L / 2R) to either side. There the
    direction is off by up to t, evenly, and the arc lies R (1 - cos) off the tangent. The means of their squares are
    t^2 / 3 and R^2 t^4 / 20.
    """
    cov = np.zeros((len(lines_world), 2, 2))
    lengths = np.hypot(*(ends_world[:, 1] - ends_world[:, 0]).T)
    for row in np.flatnonzero(lengths <= config.wall_m).tolist():
        radius_m = radius_of(row, lines_world, ends_world, config)
        if radius_m > 0.0:
            turn = np.arcsin(min(0.5 * lengths[row] / radius_m, 1.0))
            cov[row] = np.diag([turn**2 / 3.0, radius_m**2 * turn**4 / 20.0])
    return cov


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
