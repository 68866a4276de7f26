"""Positions of nodes and edges of a visibility graph: beside the walls, around their corners, across the floor."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

CURVED = 0.07
"""Curvature of an edge across the floor, as a share of its length."""
ROUNDS = 60
"""Largest number of rounds in which nodes are moved apart."""
POINTS = 17
"""Number of points of a curve."""
STRAIGHT = 0.1
"""Walls that turn by less, as a sine, continue straight."""
FAR = 6.0
"""Limit of the distance at which an edge passes a corner, as a multiple of its distance from the wall."""
CLEAR = 1.3
"""Distance from the centre of a circle at which an edge ends, in radii."""


@dataclass(frozen=True)
class Nodes:
    """Equal circles beside the middles of walls, on the free side, moved apart where they would overlap."""

    at: Float[np.ndarray, "n 2"]
    radius_m: float
    ends_world: Float[np.ndarray, "n 2 2"]

    def sights(self, pairs: Int[np.ndarray, "e 2"]) -> Float[np.ndarray, "e p 2"]:
        """Return a slight curve for each pair, from the rim of one circle to that of the other."""
        a, b = self.at[pairs[:, 0]], self.at[pairs[:, 1]]
        way = b - a
        middle = 0.5 * (a + b) + CURVED * np.stack([way[:, 1], -way[:, 0]], axis=-1)
        # The curve is flat enough to treat its parameter as arc length.
        cut = np.minimum(CLEAR * self.radius_m / np.maximum(np.hypot(*way.T), 1e-9), 0.45)
        return bezier(a, middle, b, cut[:, None] + np.linspace(0.0, 1.0, POINTS) * (1.0 - 2.0 * cut[:, None]))

    def round_corner(self, first: int, second: int) -> Float[np.ndarray, "p 2"]:
        """Return the curve from a wall's circle around the corner, on the free side, to its neighbour's circle.

        The second wall begins where the first one ends; the free side is on the left of both.
        """
        meet = np.stack([self.ends_world[first, 1], self.ends_world[second, 0]])
        normals, gap_m = free_normals(self.ends_world[[first, second]]), beside_m(self.radius_m)
        turn = meet.mean(axis=0) + gap_m * normals[0]
        if abs(np.linalg.det(normals)) > STRAIGHT:
            crossing = np.linalg.solve(normals, np.sum(normals * meet, axis=1) + gap_m)
            if np.hypot(*(crossing - turn)) <= FAR * gap_m:  # not far beyond a sharp corner
                turn = crossing
        a, b = self.at[first], self.at[second]
        legs = [_towards(turn, end, self.radius_m) for end in (a, b)]
        (bend,) = bezier(legs[0][None], turn[None], legs[1][None], np.linspace(0.0, 1.0, POINTS)[None])
        return np.concatenate([_towards(a, turn, self.radius_m)[None], bend, _towards(b, turn, self.radius_m)[None]])


def bezier(
    a: Float[np.ndarray, "e 2"],
    turn: Float[np.ndarray, "e 2"],
    b: Float[np.ndarray, "e 2"],
    share: Float[np.ndarray, "e p"],
) -> Float[np.ndarray, "e p 2"]:
    """Return points of curves from `a` to `b` that are drawn towards `turn`."""
    t = share[..., None]
    return (1.0 - t) ** 2 * a[:, None] + 2.0 * t * (1.0 - t) * turn[:, None] + t**2 * b[:, None]


def beside_m(radius_m: float) -> float:
    """Return the distance of each circle's centre from its wall."""
    return 1.45 * radius_m


def free_normals(ends_world: Float[np.ndarray, "n 2 2"]) -> Float[np.ndarray, "n 2"]:
    """Return the unit normals of walls towards their free side, which is on the left."""
    way = ends_world[:, 1] - ends_world[:, 0]
    return np.stack([-way[:, 1], way[:, 0]], axis=-1) / np.maximum(np.hypot(*way.T), 1e-9)[:, None]


def nodes_of(ends_world: Float[np.ndarray, "n 2 2"], radius_m: float) -> Nodes:
    """Return a circle for each wall."""
    at = ends_world.mean(axis=1) + beside_m(radius_m) * free_normals(ends_world)
    return Nodes(_apart(at, 2.2 * radius_m), radius_m, ends_world)


def _apart(at: Float[np.ndarray, "n 2"], least_m: float) -> Float[np.ndarray, "n 2"]:
    """Move positions apart until no two are closer than this, or for a number of rounds."""
    at = at.copy()
    for _ in range(ROUNDS):
        between = at[:, None] - at[None]
        metres = np.hypot(*between.transpose(2, 0, 1))
        np.fill_diagonal(metres, np.inf)
        near = np.argwhere(np.triu(metres < least_m * (1.0 - 1e-6)))
        if not len(near):
            break
        for a, b in near:
            away = at[a] - at[b]
            length = float(np.hypot(*away))
            unit = away / length if length > 1e-9 else np.array([1.0, 0.0])
            push = 0.5 * max(least_m - length, 0.0) * unit
            at[a] += push
            at[b] -= push
    return at


def _towards(start: Float[np.ndarray, "2"], end: Float[np.ndarray, "2"], most_m: float) -> Float[np.ndarray, "2"]:
    """Return the point at this distance along the line from one place to another, at most half of it."""
    way = end - start
    length = float(np.hypot(*way))
    return start + way * (min(most_m, 0.5 * length) / max(length, 1e-9))


def heads(
    tips: Float[np.ndarray, "e 2"], before: Float[np.ndarray, "e 2"], size_m: float
) -> Float[np.ndarray, "e 3 2"]:
    """Return arrow heads (triangles) at the ends of curves, given each end and the point before it."""
    way = tips - before
    along = size_m * way / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    across = 0.42 * np.stack([-along[:, 1], along[:, 0]], axis=-1)
    return np.stack([tips, tips - along + across, tips - along - across], axis=1)
