"""How inconsistent a filter must be, without the truth (docs/contributing/exploration-notes.md).

Three signs: information gained along directions that no scan can tell, innovations larger than stated, and heading
lost while no wall was in sight. They predict by how much a wall that is met again will be off.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.association.matching import MatchingConfig
from chainslam.slam.estimation.backend import POSE, Belief, Joint
from chainslam.slam.estimation.gates import gate_level
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import J
from chainslam.slam.map.stochastic_map import StochasticMap

from ..following.surroundings import Surroundings
from .expectation import OBSERVATION_SIGMAS

LEVEL = MatchingConfig().gate
"""What is likelier than this is chance: the level at which a wall that is met again is refused."""
MOST_WALLS = 8
"""So many walls in sight are weighed together; more cost time and say little that is new."""


def gained_information(joint: Joint, start_world: Float[np.ndarray, 3], start_cov: Float[np.ndarray, "3 3"]) -> float:
    """Return how many times the information about a shift and turn of everything exceeds the start's, at its worst.

    Nothing that the robot sees can raise it: an honest belief has at most 1, whatever lines are in `joint`
    (docs/concepts/consistency.md, "The bound"). Infinite for a covariance that is none.
    """
    N = motion_of_everything(joint)
    to_start = np.eye(POSE)
    to_start[:2, 2] = -J @ start_world[:2]
    scale = np.sqrt(np.diagonal(joint.cov))
    if not np.all(scale > 0.0):
        return np.inf
    scaled = N / scale[:, None]
    information = scaled.T @ np.linalg.solve(joint.cov / np.outer(scale, scale), scaled)
    return float(np.linalg.eigvals(information @ to_start @ start_cov @ to_start.T).real.max())


def motion_of_everything(joint: Joint) -> Float[np.ndarray, "s 3"]:
    """Return how pose and lines change with a shift (m, m) and a turn (rad) of everything about the world's origin."""
    pose, alpha = joint.mean[:POSE], joint.mean[POSE::2]
    n = normals(alpha)
    N = np.zeros((len(joint.mean), POSE))
    N[:POSE] = np.eye(POSE)
    N[:2, 2] = J @ pose[:2]
    N[POSE::2, 2] = 1.0
    N[POSE + 1 :: 2, :2] = n
    N[POSE + 1 :: 2, 2] = np.vecdot(n, joint.anchors @ J.T)
    return N


class Monitor:
    """Watches a mission step by step, and predicts by how much a well-known wall would be off if it were met again.

    Well known are the walls in sight at the start, and those seen beside one of them when a return ended.
    """

    def __init__(self) -> None:
        self.known: set[int] = set()
        self._start: tuple[Float[np.ndarray, 3], Float[np.ndarray, "3 3"]] | None = None
        self._last_known: tuple[int, ...] = ()
        self._way: list[Float[np.ndarray, 2]] = []
        self._squared, self._dof = 0.0, 0
        self._lost: Float[np.ndarray, "k 3"] = np.zeros((0, 3))
        self._lost_before: dict[int, Float[np.ndarray, "k 3"]] = {}

    @property
    def in_sight(self) -> bool:
        """Whether the last scan shows a well-known wall."""
        return not self._way

    def watch(self, around: Surroundings) -> None:
        """Take note of one more scan."""
        belief = around.walls.belief
        if self._start is None:
            self._start = belief.pose_world.copy(), belief.pose_cov.copy()
        if not self.known:
            self.known = set(around.seen)
        self._note_lost(around)
        known = self.known.intersection(around.seen)
        if known:
            self._last_known = tuple(sorted(known))
            self._way, self._squared, self._dof = [], 0.0, 0
            return
        self._way.append(belief.pose_world[:2].copy())
        self._squared += around.nis.squared
        self._dof += around.nis.dof

    def _note_lost(self, around: Surroundings) -> None:
        """Take note of the heading lost without a wall, and of that which walls from before give back."""
        before = [self._lost_before[wall] for wall in around.seen if wall in self._lost_before]
        if before:
            self._lost = min([self._lost, *before], key=lambda lost: float(lost[:, 2].sum()))
        else:
            lost = np.append(around.walls.belief.pose_world[:2], around.odometry.cov[2, 2])
            self._lost = np.vstack([self._lost, lost])
        for wall in around.seen:
            self._lost_before.setdefault(wall, self._lost)

    def learn(self, seen: Sequence[int]) -> None:
        """Take what is seen beside a well-known wall for well known, too."""
        if self.known.intersection(seen):
            self.known.update(seen)

    def overconfidence(self, around: Surroundings) -> float:
        """Return how many times the squared errors must exceed what is stated; 1 where nothing shows that they do."""
        assert self._start is not None, "expected to have watched a step"
        joint = around.walls.belief.joint(_nearest(around.walls, around.seen))
        return max(1.0, gained_information(joint, *self._start), self.surprise())

    def surprise(self) -> float:
        """Return how many times the innovations since the last well-known wall exceed the end of their band."""
        return self._squared / gate_level(LEVEL, self._dof) if self._dof else 0.0

    def predicted(self, around: Surroundings, goal_world: Float[np.ndarray, 2], metres: float) -> float:
        """Return the squared error expected of the last well-known walls, met again by way of a goal, over the stated.

        It is that across each wall, in units of the variance that the belief states; the largest counts.
        """
        belief = around.walls.belief
        walls = np.array([wall for wall in self._last_known if wall in set(belief.ids.tolist())], dtype=np.int64)
        if not self._way or not len(walls):
            return 0.0
        points = around.walls.ends_world[belief.rows(walls)].mean(axis=1)
        direction, across = stated(belief, walls, points)
        t = directions(belief.means[belief.rows(walls), 0])
        way = np.array(self._way)
        driven = float(np.hypot(*np.diff(way, axis=0).T).sum())
        shares = np.append(np.full(len(way), driven / len(way)), metres) / max(driven + metres, 1e-9)
        spread = shares @ _levers(points, t, np.vstack([way, goal_world])) ** 2
        lost = self._lost[:, 2] @ _levers(points, t, self._lost[:, :2]) ** 2
        expected = self.overconfidence(around) * direction * spread + lost
        return float(np.max(expected / (across + OBSERVATION_SIGMAS[1] ** 2)))


def stated(
    belief: Belief, walls: Int[np.ndarray, " m"], points_world: Float[np.ndarray, "m 2"]
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Return the variances that a belief states of walls as seen by the robot: of direction, and across at a point."""
    joint, rows = belief.joint(walls), belief.rows(walls)
    m, alpha = len(walls), belief.means[rows, 0]
    n, t = normals(alpha), directions(alpha)
    each = np.arange(m)
    turn, across = np.zeros((m, len(joint.mean))), np.zeros((m, len(joint.mean)))
    turn[:, 2], turn[each, POSE + 2 * each] = -1.0, 1.0
    across[:, :2] = -n
    across[:, 2] = np.vecdot(t, points_world - belief.pose_world[:2])
    across[each, POSE + 2 * each] = np.vecdot(t, belief.anchors[rows] - points_world)
    across[each, POSE + 2 * each + 1] = 1.0
    direction, offset = (np.vecdot(row, row @ joint.cov) for row in (turn, across))
    return np.asarray(direction), np.asarray(offset)


def _levers(
    points: Float[np.ndarray, "m 2"], t: Float[np.ndarray, "m 2"], places: Float[np.ndarray, "k 2"]
) -> Float[np.ndarray, "k m"]:
    """Return how far a turn at each place moves each wall's point across the wall, m a radian."""
    return np.asarray(np.sum((points - places[:, None]) * t, axis=-1))


def _nearest(walls: StochasticMap, seen: Sequence[int]) -> Int[np.ndarray, " m"]:
    """Return the ids, ascending, of the nearest of the walls that a scan shows."""
    ids = walls.ids[np.isin(walls.ids, np.array(seen, dtype=np.int64))]
    distances = walls.distances_m[walls.belief.rows(ids)]
    return np.sort(ids[np.argsort(distances, kind="stable")[:MOST_WALLS]])
