"""Maps whose walls are given."""

import numpy as np

from chainslam.slam.estimation.backend import Belief
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.stochastic_map import StochasticMap


def map_of(faces: np.ndarray, pose: np.ndarray) -> StochasticMap:
    """Return a map whose walls are these faces, seen from a pose."""
    lines, anchors = through(faces), faces.mean(axis=1)
    d = lines[:, 1] - np.sum(normals(lines[:, 0]) * anchors, axis=-1)
    half = 0.5 * np.hypot(*(faces[:, 1] - faces[:, 0]).T)
    ids, no = np.arange(len(faces)), np.zeros(len(faces), dtype=bool)
    belief = Belief(pose, np.eye(3), ids, anchors, np.stack([lines[:, 0], d], axis=-1), lambda ids: None)
    return StochasticMap(belief, np.stack([-half, half], axis=-1), np.full(len(faces), 20), no, no)
