"""A match made exact: a scan's points drawn onto the surfaces of earlier points, together with what the wheels say."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.spatial import cKDTree

from ..geometry.poses import rotation, to_world, wrap

NEAREST = 6
"""So many earlier points tell where a surface is: their mean has less noise than the nearest one."""
ROUNDS = 5
STILL_M = 1e-4
"""A round that moves less is the last one."""


@dataclass(frozen=True)
class Surfaces:
    """A scan's points, robot frame, with the unit normals of their surfaces where these are known."""

    points: Float[np.ndarray, "n 2"]
    normals: Float[np.ndarray, "n 2"]
    known: Bool[np.ndarray, " n"]


@dataclass(frozen=True)
class Prior:
    """A pose that is known without the scan, and its information."""

    pose: Float[np.ndarray, "3"]
    information: Float[np.ndarray, "3 3"]


def settle(
    tree: cKDTree, surfaces: Surfaces, start: Float[np.ndarray, "3"], prior: Prior, sigma_m: float, reach_m: float
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Return the pose near a start that agrees best with earlier points and the prior, and the points' information.

    Each point says how far it is off across its surface, and nothing along it; farther off than `reach_m` it says
    nothing at all, and before that the less the farther. Gauss and Newton's method with fixed weights in each round.
    """
    points, normals = surfaces.points[surfaces.known], surfaces.normals[surfaces.known]
    earlier = np.asarray(tree.data)
    nearest = min(NEAREST, len(earlier))
    pose, information = start, np.zeros((3, 3))
    for _ in range(ROUNDS):
        placed, across = to_world(points, pose), normals @ rotation(pose[2]).T
        _, rows = tree.query(placed, k=nearest)
        surface = earlier[rows.reshape(len(points), nearest)].mean(axis=1)
        off = surface - placed
        left = np.vecdot(across, off)
        weights = np.exp(-0.5 * (np.hypot(*off.T) / reach_m) ** 2) / sigma_m**2
        arm = placed - pose[:2]
        jacobian = np.column_stack([across, across[:, 1] * arm[:, 0] - across[:, 0] * arm[:, 1]])
        information = (weights[:, None] * jacobian).T @ jacobian
        away = prior.pose - pose
        away[2] = wrap(away[2])
        gradient = jacobian.T @ (weights * left) + prior.information @ away
        change = np.linalg.solve(information + prior.information, gradient)
        pose = pose + change
        if np.abs(change).max() < STILL_M:
            break
    return np.array([pose[0], pose[1], wrap(pose[2])]), information
