"""A match made exact: a scan's points drawn onto the surfaces of earlier points, together with what the wheels say."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..geometry.poses import wrap
from .surface_kernels import Buckets, normal_equations

ROUNDS = 5
"""No more rounds are made, so that no search takes long."""
STILL_M = 1e-4
"""A round that moves less is the last one."""


@dataclass(frozen=True)
class Surfaces:
    """Those of a scan's points, robot frame, whose surfaces have known unit normals."""

    points: Float[np.ndarray, "n 2"]
    normals: Float[np.ndarray, "n 2"]


@dataclass(frozen=True)
class Prior:
    """A pose that is known without the scan, and its information."""

    pose: Float[np.ndarray, "3"]
    information: Float[np.ndarray, "3 3"]


def settle(
    earlier: Buckets, surfaces: Surfaces, start: Float[np.ndarray, "3"], prior: Prior, sigma_m: float, reach_m: float
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Return the pose near a start that agrees best with earlier points and the prior, and the points' information.

    Gauss and Newton's method with fixed weights in each round.
    """
    pose, information = start, np.zeros((3, 3))
    for _ in range(ROUNDS):
        information, gradient = normal_equations(earlier, surfaces.points, surfaces.normals, pose, sigma_m, reach_m)
        away = prior.pose - pose
        away[2] = wrap(away[2])
        change = np.linalg.solve(information + prior.information, gradient + prior.information @ away)
        pose = pose + change
        if np.abs(change).max() < STILL_M:
            break
    return np.array([pose[0], pose[1], wrap(pose[2])]), information
