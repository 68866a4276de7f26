"""Maps of drawn buildings: every face of the drawing is a wall, known to a stated covariance."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from chainslam.experiments.views.plans.faces import Faces
from chainslam.slam.geometry.lines import normals, through

SIGMAS = np.array([1e-3, 2e-3])
"""Of alpha rad and d m."""


def two_rooms(furniture=False):
    """A room of 4 x 3 m and one of 3 x 3 m, a wall of 0.1 m between, and in it a door of 0.9 m."""
    floor = shapely.union_all([shapely.box(0, 0, 4, 3), shapely.box(4.1, 0, 7.1, 3), shapely.box(3.9, 1, 4.2, 1.9)])
    if furniture:
        floor = floor.difference(shapely.box(1, 1, 1.8, 1.6))
    return orient(floor.simplify(1e-9), 1.0)


def edges(floor):
    rings = [shapely.get_coordinates(ring) for ring in (floor.exterior, *floor.interiors)]
    return [np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings]


def mapped(floor, turn=0.0):
    """The map of a floor, without an error, turned about the origin."""
    rings = edges(floor)
    c, s = np.cos(turn), np.sin(turn)
    ends = np.concatenate(rings) @ np.array([[c, s], [-s, c]])
    lines, anchors = through(ends), ends.mean(axis=1)
    half = 0.5 * np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    starts = np.cumsum([0, *map(len, rings)])
    chains = tuple(tuple(range(a, b)) for a, b in pairwise(starts.tolist()))
    off = lines[:, 1] - np.vecdot(normals(lines[:, 0]), anchors)
    return Faces(
        np.arange(len(ends)), np.stack([lines[:, 0], off], axis=-1), anchors, half[:, None] * [-1.0, 1.0],
        np.diag([0.0, 0.0, 0.0, *np.tile(SIGMAS**2, len(ends))]), chains, (True,) * len(chains), np.zeros(3),
    )  # fmt: skip


def drawn_from(faces, chance):
    """The same map with lines drawn from its own covariance."""
    error = chance.multivariate_normal(np.zeros(len(faces.cov)), faces.cov)
    return replace(faces, means=faces.means + error[3:].reshape(-1, 2))
