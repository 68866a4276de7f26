"""The stochastic map as a factor graph: every pose kept and relinearised, solved step by step (iSAM2).

Inside, the first pose is the origin, so that no answer depends on where the world has its own. The calls of one step
are collected and handed to iSAM2 together when a belief is next asked for; a prediction alone is propagated without it.
"""

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np
from jaxtyping import Float, Int

from ..backend import Belief, Joint, Observations, StaleBeliefError
from ..geometry.lines import directions, normals
from ..geometry.poses import compose, rotation, to_robot, to_world, wrap
from ..models import grow, move
from ..robot import Odometry
from .graph_loose import wrapped
from .graph_record import LineRecord, Record
from .graph_solver import GraphConfig, Solver

DEFAULTS = GraphConfig()
G = TypeVar("G", bound="Graph")


class Graph:
    """Incremental smoothing of all poses and lines; a joint back end, so each sighting counts once."""

    def __init__(
        self,
        pose_world: Float[np.ndarray, "3"],
        pose_cov: Float[np.ndarray, "3 3"],
        config: GraphConfig = DEFAULTS,
    ) -> None:
        """Start at a pose with its covariance and an empty map."""
        self._config = config
        self._version = 0
        self._belief: Belief | None = None
        self._ids = np.zeros(0, dtype=np.int64)
        self._record = Record(np.array(pose_world, dtype=np.float64), np.array(pose_cov, dtype=np.float64))
        self._start_from(np.zeros((1, 3)), np.zeros((0, 2)))

    # -- the Backend protocol ---------------------------------------------------------------------------------------

    @property
    def belief(self) -> Belief:
        """The estimate now."""
        if self._belief is None:
            self._solver.settle()
            self._belief = self._believe()
        return self._belief

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by what the wheels report; it becomes a pose of the graph with the next scan."""
        self._move_on()
        self._record.move(odometry)

    def update(self, first: Observations, second: Observations) -> None:
        """Take in one scan's matches (`second`; a joint back end has no use for `first`)."""
        if not len(second.ids):
            return
        rows = self._rows(second.ids)
        self._move_on()
        self._solver.enter_poses()
        alpha = self._solver.lines[rows, 0]
        epsilon = wrap(second.lines[:, 0] - alpha + self._solver.pose[2])
        for k in np.lexsort((second.lines[:, 1], second.lines[:, 0], second.ids)).tolist():
            line = int(second.ids[k])
            number = self._record.see(self._solver.last, line, second.lines[k], second.cov[k])
            self._solver.enter_sighting(line, number, float(epsilon[k]), float(alpha[k]))

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Add lines seen in the robot frame and return their ids; they are anchored where they were seen."""
        solver = self._all_entered()
        new = grow(solver.pose, lines, centres, at_wall=False)
        anchors = to_world(to_world(centres, solver.pose), self._record.pose_world)
        ids = np.arange(self._record.next_id, self._record.next_id + len(lines))
        self._record.next_id += len(lines)
        solver.enter_lines(ids.tolist(), new.means)
        for k, line in enumerate(ids.tolist()):
            self._record.lines[line] = LineRecord(anchors[k])
            number = self._record.see(solver.last, line, lines[k], cov[k])
            solver.enter_sighting(line, number, 0.0, float(new.means[k, 0]))
        self._ids = np.concatenate([self._ids, ids])
        self._anchor(np.concatenate([self._anchors, anchors]))
        return ids

    def merge(self, keep: int, drop: int) -> None:
        """Make two lines one: the sightings of `drop` become sightings of `keep`."""
        keep_row, drop_row = self._rows([keep, drop])
        if keep == drop:
            raise ValueError(f"expected two lines to merge, found line {keep} twice")
        solver = self._settled()
        alpha = float(solver.lines[keep_row, 0])
        moved = self._record.lines[drop].sightings
        headings = {index: float(solver.pose_at(index)[2]) for index in {self._record.seen_from[n] for n in moved}}
        solver.leave_sightings(drop, moved)
        for number in moved:
            epsilon = wrapped(self._record.seen[number][0] - alpha + headings[self._record.seen_from[number]])
            solver.enter_sighting(keep, number, epsilon, alpha)
        self._record.lines[keep].sightings.extend(moved)
        self._drop(drop)
        self._hide(np.array([drop_row]))
        solver.unsettle()

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map.

        What their sightings said of the rest stays, as when a filter forgets a line: lines seen more than once are no
        longer shown, but remain in the graph. To undo what a wrong line did, `retract` it.
        """
        rows = self._rows(ids)
        solver = self._settled()
        for line in self._ids[rows].tolist():
            sightings = self._record.lines[line].sightings
            if len(sightings) > 1:
                self._record.lines[line].shown = False
            else:  # The one sighting of a line says nothing of the rest.
                solver.leave_sightings(line, sightings)
                self._drop(line)
        self._hide(rows)

    # -- what only a graph can do -----------------------------------------------------------------------------------

    def retract(self, ids: Sequence[int]) -> None:
        """Take lines out with all that was ever seen of them, as if those sightings had not been used at all."""
        rows = self._rows(ids)
        solver = self._settled()
        for line in self._ids[rows].tolist():
            solver.leave_sightings(line, self._record.lines[line].sightings)
            self._drop(line)
        self._hide(rows)
        solver.unsettle()

    def retract_sightings(self, line: int, numbers: Sequence[int]) -> None:
        """Undo wrong matches with a line, by the numbers that `sightings_of` gives; without any left it is removed."""
        (row,) = self._rows([line])
        sightings = self._record.lines[line].sightings
        if unknown := set(numbers).difference(sightings):
            raise KeyError(f"expected numbers of sightings of line {line}, found {sorted(unknown)}")
        solver = self._settled()
        solver.leave_sightings(line, sorted(set(numbers)))
        sightings[:] = [number for number in sightings if number not in set(numbers)]
        if not sightings:
            self._drop(line)
            self._hide(np.array([row]))
        solver.unsettle()

    def sightings_of(self, line: int) -> Int[np.ndarray, "m 2"]:
        """Return rows (number of the sighting, predictions made before it) of a line, oldest first."""
        self._rows([line])
        numbers = np.array(sorted(self._record.lines[line].sightings), dtype=np.int64)
        poses = np.array(self._record.seen_from, dtype=np.int64)[numbers]
        return np.stack([numbers, np.searchsorted(self._record.poses_of_steps, poses)], axis=-1)

    def trajectory(self) -> Float[np.ndarray, "n 3"]:
        """Return the present estimates of the pose at the start and after every prediction, world frame (smoothed)."""
        poses = self._all_entered().poses()
        return np.array([compose(self._record.pose_world, poses[k]) for k in self._record.poses_of_steps])

    def relinearise(self) -> None:
        """Linearise everything anew at the present estimates."""
        solver = self._all_entered()
        self._start_from(solver.poses(), solver.all_lines())

    def arrays(self) -> dict[str, np.ndarray]:
        """Return prior, odometry, sightings and the points of linearisation as plain arrays, for `numpy.savez`."""
        solver = self._all_entered()
        return {**self._record.arrays(), "poses": solver.poses(True), "lines": solver.all_lines(True)}

    @classmethod
    def from_arrays(cls: type[G], arrays: Mapping[str, np.ndarray], config: GraphConfig = DEFAULTS) -> G:
        """Return the graph of which `arrays` were made; raises ValueError for another format."""
        record = Record.from_arrays(arrays)
        graph = cls(record.pose_world, record.pose_cov, config)
        graph._record = record
        graph._start_from(arrays["poses"], arrays["lines"], anew=False)
        return graph

    # -- inside -----------------------------------------------------------------------------------------------------

    def _start_from(self, poses: Float[np.ndarray, "p 3"], lines: Float[np.ndarray, "n 2"], anew: bool = True) -> None:
        """Make the graph of the record anew, linearised at these poses and lines (inner frame)."""
        self._move_on()
        self._solver = Solver(self._config, self._record, poses, lines, anew)
        self._ids = np.array([line for line, at in self._record.lines.items() if at.shown], dtype=np.int64)
        self._anchor(np.array([self._record.lines[line].anchor for line in self._ids.tolist()]).reshape(-1, 2))
        self._solver.settle()

    def _move_on(self) -> None:
        self._version += 1
        self._belief = None

    def _settled(self) -> Solver:
        """Solve for all that was entered, and make beliefs stale."""
        self._solver.settle()
        self._move_on()
        return self._solver

    def _all_entered(self) -> Solver:
        """Solve for all that was entered, then enter the predictions that wait."""
        solver = self._settled()
        solver.enter_poses()
        return solver

    def _rows(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return where the ids stand among the lines shown; raises KeyError for others."""
        wanted = np.asarray(ids, dtype=np.int64)
        rows = np.searchsorted(self._ids, wanted)
        found = rows < len(self._ids)
        found[found] = self._ids[rows[found]] == wanted[found]
        if not np.all(found):
            raise KeyError(f"expected ids of lines in the map, found {wanted[~found].tolist()}")
        return rows

    def _anchor(self, anchors: Float[np.ndarray, "n 2"]) -> None:
        self._anchors, self._inner_anchors = anchors, to_robot(anchors, self._record.pose_world)

    def _hide(self, rows: Int[np.ndarray, " m"]) -> None:
        self._solver.hide(rows)
        kept = np.ones(len(self._ids), dtype=bool)
        kept[rows] = False
        self._ids = self._ids[kept]
        self._anchor(self._anchors[kept])

    def _drop(self, line: int) -> None:
        del self._record.lines[line]
        self._solver.drop(line)

    def _believe(self) -> Belief:
        version, anchors = self._version, self._anchors
        ahead = _Ahead(compose(self._record.pose_world, self._solver.pose))
        for index in range(self._solver.last, len(self._record.motions)):
            ahead.move(self._record.motions[index], self._record.motion_covs[index])
        means = self._solver.lines.copy()
        means[:, 1] -= np.sum(normals(means[:, 0]) * self._inner_anchors, axis=-1)
        means[:, 0] = wrap(means[:, 0] + self._record.pose_world[2])
        answers: list[tuple[Int[np.ndarray, " m"], Float[np.ndarray, "s s"]]] = []

        def query(wanted: Int[np.ndarray, " m"]) -> Joint:
            if version != self._version:
                raise StaleBeliefError("expected a belief of the present step, found one whose back end has moved on")
            rows = belief.rows(wanted)
            if not answers or not np.all(np.isin(rows, answers[0][0])):
                cov = ahead.joint_cov(self._joint_cov(rows))
                cov[:3, :3] = belief.pose_cov
                answers[:] = [(rows, cov)]
            known, cov = answers[0]
            order = np.argsort(known)
            at = order[np.searchsorted(known, rows, sorter=order)]
            index = np.concatenate([np.arange(3), (3 + 2 * at[:, None] + np.arange(2)).ravel()])
            mean = np.concatenate([belief.pose_world, belief.means[rows].ravel()])
            return Joint(mean, cov[np.ix_(index, index)], anchors[rows])

        belief = Belief(ahead.pose_world, ahead.pose_cov(self._solver.pose_cov()), self._ids, anchors, means, query)
        return belief

    def _joint_cov(self, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "s s"]:
        """Return the covariance of the last pose (body frame) and these lines (alpha, d)."""
        cov = self._solver.joint_cov(rows)
        # d = r - n(alpha)·c, so dd = dr - (t·c) dalpha.
        lever = np.sum(directions(self._solver.lines[rows, 0]) * self._inner_anchors[rows], axis=-1)
        cov[4::2] -= lever[:, None] * cov[3::2]
        cov[:, 4::2] -= lever * cov[:, 3::2]
        return 0.5 * (cov + cov.T)


class _Ahead:
    """A pose some predictions ahead of the last pose of the graph."""

    def __init__(self, pose_world: Float[np.ndarray, "3"]) -> None:
        self.pose_world = pose_world
        self._F, self._Q = np.eye(3), np.zeros((3, 3))
        self._F[:2, :2] = rotation(pose_world[2])

    def move(self, motion: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> None:
        step = move(self.pose_world, motion)
        self.pose_world = step.pose_world
        self._F = step.F @ self._F
        self._Q = step.F @ self._Q @ step.F.T + step.W @ cov @ step.W.T

    def pose_cov(self, cov_body: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
        cov = self._F @ cov_body @ self._F.T + self._Q
        return 0.5 * (cov + cov.T)

    def joint_cov(self, cov: Float[np.ndarray, "s s"]) -> Float[np.ndarray, "s s"]:
        cov[:3, 3:] = self._F @ cov[:3, 3:]
        cov[3:, :3] = cov[:3, 3:].T
        return cov
