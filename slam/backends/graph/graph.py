"""The stochastic map as a factor graph: every pose kept and relinearised, solved step by step (iSAM2).

Inside, the pose from which the first wall was seen is the origin: no scan tells where that pose lies in the world, and
what prior and odometry told of it is kept beside the graph (`Frame`). The calls of one step are collected and handed to
iSAM2 together when a belief is next asked for; a prediction alone is propagated without it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Belief, ContradictionError, Observations
from ...estimation.models import initialise
from ...geometry.poses import to_robot, to_world
from ...robot import Odometry
from .belief import believe, pair_covs
from .config import GraphConfig
from .loose import wrapped
from .optimum import solve_anew
from .record import LineRecord, Record
from .solver import DivergedError, Solver

DEFAULTS = GraphConfig()
G = TypeVar("G", bound="Graph")
FAULTS = (RuntimeError, ValueError, IndexError)
"""What GTSAM and `Solver` raise where they cannot go on."""


class UnsolvableError(RuntimeError):
    """There is no least-squares solution, not even without what was entered last: nothing can be entered any more."""


class Graph:
    """Incremental smoothing of all poses and lines; a joint back end, so each observation counts once."""

    def __init__(
        self,
        pose_world: Float[np.ndarray, "3"],
        pose_cov: Float[np.ndarray, "3 3"],
        config: GraphConfig = DEFAULTS,
    ) -> None:
        """Start at a pose with its covariance and an empty map."""
        self.config = config
        self.recoveries = 0
        """How often a solution did not hold and everything was solved anew."""
        self._version = 0
        self._belief: Belief | None = None
        self._held: Belief | None = None
        """The last belief of a solution that held."""
        self._is_lost = False
        """Whether there was no solution even without the last scan: nothing can be entered any more."""
        self._record = Record(np.array(pose_world, dtype=np.float64), np.array(pose_cov, dtype=np.float64))
        self._holds = 0, 0
        """Observations and ids of which a solution was found."""
        self._start_from(np.zeros((1, 3)), np.zeros((0, 2)))

    # -- the Backend protocol ---------------------------------------------------------------------------------------

    @property
    def belief(self) -> Belief:
        """The estimate now; where no solution is left, the last one that held, without its joint covariance.

        Raises ContradictionError where no least-squares solution agrees with what was entered since the last one.
        """
        if self._is_lost and self._held is not None:
            return self._held
        if self._belief is None:
            self._settle()
            version = self._version
            self._belief = believe(
                self._solver, self._record, self._anchors, self._inner_anchors, lambda: version == self._version
            )
            self._held = self._belief
        return self._belief

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by the odometry; it becomes a pose of the graph with the next scan."""
        self._move_on()
        self._record.move(odometry)

    def update(self, first: Observations, second: Observations) -> None:
        """Take in one scan's matches (`second`; a joint back end has no use for `first`)."""
        if not len(second.ids):
            return
        rows = self._rows(second.ids)
        self._move_on()
        self._solver.enter_poses()
        self._solver.enter_scan(rows, second.lines, second.cov)

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Add lines seen in the robot frame and return their ids; they are anchored where they were seen."""
        self._move_on()
        self._solver.enter_poses()
        new = initialise(self._solver.pose, lines, centres, at_wall=False)
        anchors = self._record.frame.anchors_world(to_world(centres, self._solver.pose))
        ids = np.arange(self._record.next_id, self._record.next_id + len(lines))
        self._record.next_id += len(lines)
        self._record.lines |= {line: LineRecord(anchor) for line, anchor in zip(ids.tolist(), anchors, strict=True)}
        self._solver.enter_lines(ids.tolist(), new.means, lines, cov)
        self._anchor(np.concatenate([self._anchors, anchors]))
        return ids

    def merge(self, keep: int, drop: int) -> None:
        """Make two lines one: the observations of `drop` become observations of `keep`."""
        keep_row, drop_row = self._rows([keep, drop])
        if keep == drop:
            raise ValueError(f"expected two lines to merge, found line {keep} twice")
        solver = self._settled()
        alpha = float(solver.lines[keep_row, 0])
        moved = self._record.lines[drop].observations
        headings = {index: float(solver.isam.pose(index)[2]) for index in {self._record.seen_from[n] for n in moved}}
        solver.leave_observations(drop, moved)
        for number in moved:
            epsilon = wrapped(self._record.seen[number][0] - alpha + headings[self._record.seen_from[number]])
            solver.enter_observation(keep, number, epsilon, alpha)
        self._record.lines[keep].observations.extend(moved)
        self._drop(drop)
        self._hide(np.array([drop_row]))

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map.

        What their observations said of the rest stays, as when a filter forgets a line: lines seen more than once are
        no longer shown, but remain in the graph.
        """
        rows = self._rows(ids)
        solver = self._settled()
        for line in self._solver.ids[rows].tolist():
            observations = self._record.lines[line].observations
            if len(observations) > 1:
                self._record.lines[line].shown = False
            else:  # The one observation of a line says nothing of the rest.
                solver.leave_observations(line, observations)
                self._drop(line)
        self._hide(rows)

    # -- what only a graph can do -----------------------------------------------------------------------------------

    def trajectory(self) -> Float[np.ndarray, "n 3"]:
        """Return the present estimates of the pose at the start and after every prediction, world frame (smoothed).

        Where no solution is left they are where it was linearised last, within `GraphConfig.relinearise_place_m` of it.
        """
        return self._record.path_world(self._last_known()[0] if self._is_lost else self._all_entered().poses())

    def pair_covs(self, first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 6 6"]:
        """Return the joint covariance of pairs of poses by their rows in `trajectory`, each error in its pose's frame.

        NaN for a pose of before the first wall, which the graph does not hold.
        """
        return pair_covs(self._all_entered(), self._record, first, second)

    def relinearise(self) -> None:
        """Linearise everything anew at the present estimates."""
        solver = self._all_entered()
        self._start_from(solver.poses(), solver.all_lines())

    def arrays(self) -> dict[str, np.ndarray]:
        """Return prior, odometry, observations and the points of linearisation as plain arrays, for `numpy.savez`."""
        if not self._is_lost:
            self._all_entered()
        poses, lines = self._last_known()
        return {**self._record.arrays(), "poses": poses, "lines": lines}

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
        self._solver = Solver(self.config, self._record, poses, lines, anew)
        self._anchor_shown()
        self._settle()

    def _settle(self) -> None:
        """Solve for all that was entered; where iSAM2 fails or goes astray, solve all of the record anew.

        Raises ContradictionError where that fails too: the observations since the last solution are then taken out,
        and the graph is as it was before them.
        """
        if self._is_lost:
            raise UnsolvableError("expected a graph with a solution, found one that lost its last: begin a new one")
        try:
            self._solver.settle()
        except FAULTS as error:
            self._recover(error)
        self._holds = len(self._record.seen), self._record.next_id

    def _recover(self, error: Exception) -> None:
        self.recoveries += 1
        if not isinstance(error, DivergedError):
            self.config = replace(self.config, careful=True)
        start = self._solver.start()
        try:
            self._solver = solve_anew(self.config, self._record, *start)
        except FAULTS:
            self._take_back(*start)
            words = " ".join(str(error).split()).partition(" Thrown when")[0]
            raise ContradictionError(
                f"expected a least-squares solution of {len(start[0])} poses and {len(start[1])} lines, found"
                f" {words}: the last scan is taken out again"
            ) from error

    def _take_back(self, poses: Float[np.ndarray, "p 3"], lines: Float[np.ndarray, "n 2"]) -> None:
        """Take out the observations since the last solution; raises UnsolvableError where even the rest has none."""
        known = np.array([line < self._holds[1] for line in self._record.lines], dtype=bool)
        self._record.forget(*self._holds)
        try:
            self._solver = solve_anew(self.config, self._record, poses, lines[known])
        except FAULTS as error:
            self._solver, self._is_lost = Solver(self.config, self._record, poses, lines[known]), True
            raise UnsolvableError(f"expected a solution without the last scan, found {error}") from error
        self._anchor_shown()

    def _last_known(self) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, "n 2"]]:
        """Return where all that was entered is linearised, the predictions that wait entered too."""
        self._solver.enter_poses()
        return self._solver.start()

    def _move_on(self) -> None:
        self._version += 1
        self._belief = None

    def _settled(self) -> Solver:
        """Solve for all that was entered, and make beliefs stale."""
        self._settle()
        self._move_on()
        return self._solver

    def _all_entered(self) -> Solver:
        """Solve for all that was entered, the predictions that wait too."""
        self._settled().enter_poses()
        return self._settled()

    def _rows(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return where the ids stand among the lines shown; raises KeyError for others."""
        wanted = np.asarray(ids, dtype=np.int64)
        ids = self._solver.ids
        rows = np.searchsorted(ids, wanted)
        found = rows < len(ids)
        found[found] = ids[rows[found]] == wanted[found]
        if not np.all(found):
            raise KeyError(f"expected ids of lines in the map, found {wanted[~found].tolist()}")
        return rows

    def _anchor_shown(self) -> None:
        shown = self._solver.ids.tolist()
        self._anchor(np.array([self._record.lines[line].anchor for line in shown]).reshape(-1, 2))

    def _anchor(self, anchors: Float[np.ndarray, "n 2"]) -> None:
        self._anchors, self._inner_anchors = anchors, to_robot(anchors, self._record.frame.pose_world)

    def _hide(self, rows: Int[np.ndarray, " m"]) -> None:
        self._solver.hide(rows)
        self._anchor(np.delete(self._anchors, rows, axis=0))

    def _drop(self, line: int) -> None:
        del self._record.lines[line]
