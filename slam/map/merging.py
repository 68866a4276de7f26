"""One wall that stands in the map twice: found by where the landmarks lie, believed by their joint covariance.

At both ends of the shorter one they are no farther apart than the accuracy of ends, and overlap by as much: a niche is
a wall's thickness deep, and the walls of two rooms on one line are as far apart, however uncertain both are. The angle
between them must be known to a degree, since merging a wall that bends by as much makes it straight for good.
"""

import math

import numpy as np
from jaxtyping import Int

from ..estimation.backend import Joint
from ..estimation.gates import gate_level
from ..estimation.shared import SharedConfig
from ..geometry.lines import directions, normals
from ..geometry.numerics import LEAST_SIGMA
from .kernels import merging_kernels
from .stochastic_map import StochasticMap


def duplicate_of(
    walls: StochasticMap, touched: Int[np.ndarray, " t"], one_wall: float, shared: SharedConfig = SharedConfig()
) -> tuple[int, int] | None:
    """Return the ids (older, younger) of two landmarks of one wall, one of them among `touched` ids, or None.

    `one_wall` is the probability level of the chi-square gate on the difference of the two lines.

    The belief is asked once at most, for all that geometry leaves; the likeliest place for a mistake, a large
    uncertainty between the two, is what the bounds of geometry are for.
    """
    pairs = lying_along(walls, touched, shared)
    if not len(pairs):
        return None
    ids = np.unique(pairs)
    joint = walls.belief.joint(ids)
    for pair, rows in zip(pairs.tolist(), np.searchsorted(ids, pairs), strict=True):
        two = joint.take(rows)
        turn = two.cov[3, 3] + two.cov[5, 5] - 2.0 * two.cov[3, 5]
        if turn <= shared.known_rad**2 and same_line(two, one_wall):
            return pair[0], pair[1]
    return None


def lying_along(walls: StochasticMap, touched: Int[np.ndarray, " t"], shared: SharedConfig) -> Int[np.ndarray, "p 2"]:
    """Return the pairs of ids (older first) of trusted walls on one side that lie along each other, by position."""
    known = walls.ids, touched, walls.tentative, walls.belief.means, walls.ends_world, walls.extents
    pairs = merging_kernels.lying_along(*known, math.cos(shared.straight_rad), float(shared.resolution_m))
    return walls.ids[pairs]


def same_line(joint: Joint, gate: float) -> bool:
    """Whether the two lines of a joint Gaussian may be one, by the chi-square gate on their difference."""
    (alpha_a, d_a), (alpha_b, d_b) = joint.mean[3:].reshape(2, 2)
    shift = joint.anchors[1] - joint.anchors[0]
    lever = directions(alpha_b) @ shift
    e = np.array([np.sin(alpha_b - alpha_a), d_b + normals(alpha_b) @ shift - d_a])
    D = np.array([[-1.0, 0.0, 1.0, 0.0], [0.0, -1.0, lever, 1.0]])
    S = D @ joint.cov[3:, 3:] @ D.T + LEAST_SIGMA**2 * np.eye(2)
    return bool(np.cos(alpha_b - alpha_a) > 0 and e @ np.linalg.solve(S, e) <= gate_level(gate, 2))
