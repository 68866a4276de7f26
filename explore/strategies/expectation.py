"""What the map says about a place before the robot goes there: how well it would know where it stands, and what it
would learn about the walls (derived in docs/concepts/exploration.md). Pure functions of the joint covariance.
"""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import J
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import WheelSpec

POSE = 3
"""Rows of the pose in the joint state."""
OBSERVATION_SIGMAS = np.array([0.005, 0.004])
"""What one look at a wall leaves open: its direction rad, its distance m."""
SIGHT_SHARE = 0.875
"""Walls within this share of the scanner's range are expected to be seen: 3.5 m of 4 m."""


@dataclass(frozen=True)
class Expectation:
    """What is expected of one place."""

    pose_cov: Float[np.ndarray, "3 3"]
    """Covariance of the pose after a look at the walls there."""
    map_gain_nats: float
    """What that look tells about those walls: the fall of their joint entropy."""


def walls_seen_from(
    walls: StochasticMap,
    graph: nx.DiGraph[int],
    wall: int,
    place_world: Float[np.ndarray, 2],
    reach_m: float,
    most: int = 8,
) -> Int[np.ndarray, " m"]:
    """Return the ids of the nearest walls that can be seen from a place beside `wall`, by the visibility graph."""
    known = np.array([wall, *(graph.successors(wall) if wall in graph else ())], dtype=np.int64)
    known = known[np.isin(known, walls.ids)]
    rows = walls.belief.rows(known)
    gap = place_world - _nearest_points(walls, rows, place_world)
    on_free_side = np.sum(gap * normals(walls.belief.means[rows, 0]), axis=-1) <= 0.0
    distance = np.where(on_free_side | (known == wall), np.hypot(*gap.T), np.inf)
    order = np.argsort(distance, kind="stable")[:most]
    return np.sort(known[order[distance[order] <= reach_m]])


def expect(
    walls: StochasticMap,
    seen: Int[np.ndarray, " m"],
    place_world: Float[np.ndarray, 2],
    metres: float,
    wheels: WheelSpec = WheelSpec(),
) -> Expectation:
    """Return what is expected of driving `metres` to a place and looking at some walls from there."""
    joint = walls.belief.joint(seen)
    cov = _on_arrival(joint.cov, place_world - walls.belief.pose_world[:2], metres, drift_sigmas(wheels))
    H = _looks(walls, seen, place_world)
    R = np.diag(np.tile(OBSERVATION_SIGMAS**2, len(seen)))
    PHt = cov @ H.T
    after = cov - PHt @ np.linalg.solve(H @ PHt + R, PHt.T)
    gain = 0.5 * (_log_det(cov[POSE:, POSE:]) - _log_det(after[POSE:, POSE:]))
    return Expectation(after[:POSE, :POSE], float(max(gain, 0.0)) if np.isfinite(gain) else 0.0)


def drift_sigmas(wheels: WheelSpec) -> Float[np.ndarray, 3]:
    """Return what each root metre of the way adds to the pose (m, m, rad), to one digit of the turn.

    The wheels slip while walls hold the heading.
    """
    turn = float(f"{np.hypot(wheels.slip, wheels.slip) / wheels.base_m:.0e}")
    return np.array([wheels.slip, wheels.slip, turn])


def _on_arrival(
    cov: Float[np.ndarray, "s s"], way: Float[np.ndarray, 2], metres: float, drift: Float[np.ndarray, 3]
) -> Float[np.ndarray, "s s"]:
    """Move the pose of a joint covariance: an error of heading turns the way, and the way adds drift."""
    F = np.eye(len(cov))
    F[:2, 2] = J @ way
    moved = F @ cov @ F.T
    moved[np.arange(POSE), np.arange(POSE)] += drift**2 * metres
    return moved


def _looks(
    walls: StochasticMap, seen: Int[np.ndarray, " m"], place_world: Float[np.ndarray, 2]
) -> Float[np.ndarray, "k s"]:
    """Return the Jacobian of looks at walls, each at its point nearest to the place, by the pose and the walls."""
    rows, m = walls.belief.rows(seen), len(seen)
    alpha = walls.belief.means[rows, 0]
    points, t = _nearest_points(walls, rows, place_world), directions(alpha)
    H = np.zeros((m, 2, POSE + 2 * m))
    H[:, 0, 2] = -1.0
    H[:, 1, :2] = -normals(alpha)
    H[:, 1, 2] = np.sum(t * (points - place_world), axis=-1)
    each = np.arange(m)
    H[each, 0, POSE + 2 * each] = 1.0
    H[each, 1, POSE + 2 * each] = np.sum(t * (walls.belief.anchors[rows] - points), axis=-1)
    H[each, 1, POSE + 2 * each + 1] = 1.0
    return H.reshape(2 * m, POSE + 2 * m)


def _nearest_points(
    walls: StochasticMap, rows: Int[np.ndarray, " m"], place_world: Float[np.ndarray, 2]
) -> Float[np.ndarray, "m 2"]:
    ends = walls.ends_world[rows]
    along = ends[:, 1] - ends[:, 0]
    length = np.maximum(np.sum(along**2, axis=-1), 1e-12)
    share = np.clip(np.sum((place_world - ends[:, 0]) * along, axis=-1) / length, 0.0, 1.0)
    return ends[:, 0] + share[:, None] * along


def _log_det(cov: Float[np.ndarray, "s s"]) -> float:
    return float(np.linalg.slogdet(cov)[1]) if len(cov) else 0.0
