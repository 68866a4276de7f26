"""Maps of rings of walls, made by hand."""

import numpy as np

from chainslam.slam.estimation.backend import Belief
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap


def closed_map(ring):
    """Return the map and the chain of one closed ring of points."""
    faces = np.stack([ring, np.roll(ring, -1, axis=0)], axis=1)
    lines, anchors = through(faces), faces.mean(axis=1)
    d = lines[:, 1] - np.sum(normals(lines[:, 0]) * anchors, axis=-1)
    half = 0.5 * np.hypot(*(faces[:, 1] - faces[:, 0]).T)
    belief = Belief(
        np.zeros(3), np.eye(3), np.arange(len(ring)), anchors, np.stack([lines[:, 0], d], axis=-1), lambda ids: None
    )
    no = np.zeros(len(ring), bool)
    walls = StochasticMap(belief, np.stack([-half, half], axis=-1), np.full(len(ring), 5), no, no)
    return walls, Chain(tuple(range(len(ring))), np.roll(ring, -1, axis=0), ())
