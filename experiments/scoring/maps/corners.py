"""The corners of the map with their covariances, and distances between named ones (Table 1 of the paper)."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.slam.estimation.backend import Joint
from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from .measurements import corner_jacobian

LABEL_REACH_M = 0.5
"""A named point of the drawing is matched with the nearest mapped corner within this distance, after alignment."""


@dataclass(frozen=True)
class Corner:
    """Where two walls of a chain meet."""

    chain: int
    """Index of the chain."""
    walls: tuple[int, int]
    position_world: Float[np.ndarray, "2"]
    jacobian: Float[np.ndarray, "2 s"] | None
    """Derivative by the joint state (pose and all lines); None where the walls are too near to parallel."""

    def cov(self, joint: Joint) -> Float[np.ndarray, "2 2"] | None:
        """Return the covariance of the position, m^2; None where there is no intersection."""
        return None if self.jacobian is None else self.jacobian @ joint.cov @ self.jacobian.T


def corners(walls: StochasticMap, chains: tuple[Chain, ...]) -> list[Corner]:
    """Return the corners of all chains, in order."""
    found = []
    for index, chain in enumerate(chains):
        following = (*chain.walls[1:], chain.walls[0])
        for position, first, second in zip(chain.corners_world, chain.walls, following, strict=False):
            rows = walls.belief.rows((first, second))
            jacobian = _jacobian(walls, int(rows[0]), int(rows[1]), position)
            found.append(Corner(index, (first, second), position, jacobian))
    return found


def _jacobian(
    walls: StochasticMap, first: int, second: int, position_world: Float[np.ndarray, "2"]
) -> Float[np.ndarray, "2 s"] | None:
    """Return the derivative of a corner by the joint state, None where its walls do not cross."""
    rows = [first, second]
    own, crosses = corner_jacobian(walls.belief.means[rows], walls.belief.anchors[rows], position_world)
    if not crosses:
        return None
    jacobian = np.zeros((2, 3 + 2 * len(walls)))
    for row, part in zip(rows, (own[:, :2], own[:, 2:]), strict=True):
        jacobian[:, 3 + 2 * row : 5 + 2 * row] = part
    return jacobian


def label_distances(
    found: list[Corner],
    labels: dict[str, tuple[float, float]],
    to_true: Float[np.ndarray, "3"],
    joint: Joint | None,
) -> dict[str, dict[str, Any]]:
    """Return, for each pair of named points, the true and the mapped distance m with its standard deviation.

    The mapped one is null where no corner of the map lies within half a metre of a name.
    """
    places = to_world(np.array([c.position_world for c in found]).reshape(-1, 2), to_true)
    nearest: dict[str, Corner | None] = {}
    for name, at in labels.items():
        gaps = np.hypot(*(places - np.array(at)).T)
        nearest[name] = found[int(gaps.argmin())] if len(found) and gaps.min() <= LABEL_REACH_M else None
    result = {}
    for a, b in combinations(sorted(labels), 2):
        true = float(np.hypot(*np.subtract(labels[a], labels[b])))
        result[f"{a}-{b}"] = {"true_m": true, **_distance(nearest[a], nearest[b], joint)}
    return result


def _distance(first: Corner | None, second: Corner | None, joint: Joint | None) -> dict[str, float | None]:
    if first is None or second is None:
        return {"mapped_m": None, "sigma_m": None}
    between = second.position_world - first.position_world
    length = float(np.hypot(*between))
    sigma = None
    if joint is not None and first.jacobian is not None and second.jacobian is not None and length > 0:
        gradient = (between / length) @ (second.jacobian - first.jacobian)
        sigma = float(np.sqrt(max(gradient @ joint.cov @ gradient, 0.0)))
    return {"mapped_m": length, "sigma_m": sigma}
