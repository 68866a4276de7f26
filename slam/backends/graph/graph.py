"""The stochastic map as a factor graph: every pose kept and relinearised, solved step by step (iSAM2).

Inside, the pose from which the first wall was seen is the origin: no scan tells where that pose lies in the world, and
what prior and odometry told of it is kept beside the graph (`Frame`). The calls of one step are collected and handed to
iSAM2 together when a belief is next asked for; a prediction alone is propagated without it.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import gtsam
import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Belief, ContradictionError, Joint, Observations, StaleBeliefError, rows_of
from ...estimation.models import initialise, innovations, stack
from ...geometry.lines import normals
from ...geometry.poses import to_robot, to_world
from ...robot import Odometry
from ..frame.frame import Frame
from .ahead import Ahead
from .config import GraphConfig
from .factors import line_key
from .isam import Isam, lines_of, poses_of
from .record import Record

DEFAULTS = GraphConfig()
FAULTS = (RuntimeError, ValueError, IndexError)
"""What GTSAM and `Isam` raise where they cannot go on."""


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
        self.record = Record(Frame(np.array(pose_world, dtype=np.float64), np.array(pose_cov, dtype=np.float64)))
        self._version = 0
        self._belief: Belief | None = None
        self._held: Belief | None = None
        """The last belief of a solution that held."""
        self._is_lost = False
        """Whether there was no solution even without the last scan: nothing can be entered any more."""
        self._isam = Isam(config, self.record)
        self._anchor()
        self._settle()

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
            self._belief = self._held = self._new_belief()
        return self._belief

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by the odometry; it becomes a pose of the graph with the next scan."""
        self._move_on()
        self.record.move(odometry)

    def update(self, first: Observations, second: Observations) -> None:
        """Take in one scan's matches (`second`; a joint back end has no use for `first`).

        A new pose is linearised where they put it, a Gauss-Newton step with the lines held: the odometry's error of one
        step bends the prediction of a line three metres away by a millimetre, as much as the line is known to.
        """
        if not len(second.ids):
            return
        rows = self._rows(second.ids)
        self._move_on()
        isam = self._isam
        ahead = Ahead(isam.pose, self.record.motions[isam.last :])
        isam.enter_poses()
        if isam.is_new:
            lines = isam.lines[rows]
            seen = stack(
                np.arange(len(rows)), innovations(ahead.pose, np.zeros_like(lines), lines, second.lines, second.cov)
            )
            H = seen.H[:, :3]
            isam.move(ahead.pose + ahead.Q @ H.T @ np.linalg.solve(H @ ahead.Q @ H.T + seen.R, seen.e))
        for k in np.lexsort((second.lines[:, 1], second.lines[:, 0], rows)).tolist():
            self._see(int(rows[k]), second.lines[k], second.cov[k])

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Add lines seen in the robot frame and return their ids; they are anchored where they were seen."""
        self._move_on()
        isam = self._isam
        isam.enter_poses()
        new = initialise(isam.pose, lines, centres, at_wall=False)
        ids = self.record.begin(self.record.frame.anchors_world(to_world(centres, isam.pose)))
        isam.enter_lines(ids, new.means)
        for k, row in enumerate(self._rows(ids).tolist()):
            self._see(row, lines[k], cov[k])
        self._anchor()
        return np.array(ids, dtype=np.int64)

    def merge(self, keep: int, drop: int) -> None:
        """Make two lines one: the observations of `drop` become observations of `keep`."""
        rows = self._rows([keep, drop])
        if keep == drop:
            raise ValueError(f"expected two lines to merge, found line {keep} twice")
        isam = self._settled()
        moved = self.record.lines.pop(drop).observations
        isam.leave(moved)
        for observation in moved:
            isam.enter(keep, observation)
        self.record.lines[keep].observations.extend(moved)
        self._hide(rows[1:])

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map.

        What their observations said of the rest stays, as when a filter forgets a line: lines seen more than once are
        no longer shown, but remain in the graph.
        """
        rows = self._rows(ids)
        isam = self._settled()
        for line in isam.ids[rows].tolist():
            known = self.record.lines[line]
            known.shown = False
            if len(known.observations) == 1:  # The one observation of a line says nothing of the rest.
                isam.leave(self.record.lines.pop(line).observations)
        self._hide(rows)

    # -- what only a graph can do -----------------------------------------------------------------------------------

    def trajectory(self) -> Float[np.ndarray, "n 3"]:
        """Return the present estimates of the pose at the start and after every prediction, world frame (smoothed).

        Where no solution is left they are where it was linearised last, within `GraphConfig.relinearise_place_m` of it.
        """
        values = self._last_known() if self._is_lost else self._all_entered().values()
        return self.record.path_world(poses_of(values, self._isam.last + 1))

    def pair_covs(self, first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 6 6"]:
        """Return the joint covariance of pairs of poses by their rows in `trajectory`, each error in its pose's frame.

        NaN for a pose of before the first wall, which the graph does not hold.
        """
        isam, steps = self._all_entered(), np.array(self.record.steps) - len(self.record.lead)
        covs = np.full((len(first), 6, 6), np.nan)
        for k, (a, b) in enumerate(zip(steps[first].tolist(), steps[second].tolist(), strict=True)):
            if min(a, b) >= 0:
                covs[k] = isam.pair_cov(a, b)
        return covs

    def lines(self) -> Float[np.ndarray, "n 2"]:
        """Return the present estimates (alpha, r) of all lines of the record, shown or not, in the graph's frame."""
        return lines_of(self._all_entered().values(), list(self.record.lines))

    def relinearise(self) -> None:
        """Linearise everything anew at the present estimates."""
        self._start_from(self._all_entered().values())

    # -- inside -----------------------------------------------------------------------------------------------------

    def _see(self, row: int, seen: Float[np.ndarray, "2"], cov: Float[np.ndarray, "2 2"]) -> None:
        isam = self._isam
        line, epsilon = int(isam.ids[row]), float(seen[0] - isam.lines[row, 0] + isam.pose[2])
        isam.enter(line, self.record.see(isam.last, line, seen, cov, epsilon))

    def _new_belief(self) -> Belief:
        isam, frame = self._isam, self.record.frame
        self._ahead = Ahead(isam.pose, self.record.motions[isam.last :])
        self._means = isam.lines.copy()
        self._means[:, 1] -= np.vecdot(normals(isam.lines[:, 0]), self._inner_anchors)
        pose = self._joint(np.zeros(0, dtype=np.int64), isam.pose_cov())
        means, query = frame.means_world(self._means), partial(self._query, self._version)
        return Belief(pose.mean, pose.cov, isam.ids, self._anchors, means, query)

    def _query(self, version: int, ids: Int[np.ndarray, " m"]) -> Joint:
        if version != self._version:
            raise StaleBeliefError("expected a belief of the present step, found one whose back end has moved on")
        belief = self.belief
        rows = belief.rows(ids)
        joint = self._joint(rows, self._isam.joint_cov(rows))
        joint.cov[:3, :3] = belief.pose_cov  # by sums of another size it would be rounded otherwise
        return replace(joint, anchors=belief.anchors[rows])  # there and back they would be too

    def _joint(self, rows: Int[np.ndarray, " m"], cov: Float[np.ndarray, "s s"]) -> Joint:
        mean, anchors = np.concatenate([self._ahead.pose, self._means[rows].ravel()]), self._inner_anchors[rows]
        cov_ahead = self._ahead.cov(cov, self._isam.lines[rows], anchors)
        return self.record.frame.joint_world(Joint(mean, cov_ahead, anchors))

    def _start_from(self, values: gtsam.Values) -> None:
        """Make the graph of the record anew, linearised there."""
        self._move_on()
        self._isam = Isam(self.config, self.record, values)
        self._anchor()
        self._settle()

    def _settle(self) -> None:
        """Solve for all that was entered; where iSAM2 fails or goes astray, solve all of the record anew.

        Raises ContradictionError where that fails too: the observations since the last solution are then taken out,
        and the graph is as it was before them.
        """
        if self._is_lost:
            raise UnsolvableError("expected a graph with a solution, found one that lost its last: begin a new one")
        if self._isam.is_waiting:
            try:
                self._isam.solve()
            except FAULTS as error:
                self._recover(error)
            self.record.fresh = []

    def _recover(self, error: Exception) -> None:
        """Solve the record by damped steps, with QR from now on; where that fails, without the last scan."""
        self.recoveries += 1
        self.config = replace(self.config, careful=True)
        start, poses, lines = self._last_known(), self._isam.last + 1, len(self.record.lines)
        try:
            self._solve_anew(start)
        except FAULTS:
            for line in self.record.take_back():
                start.erase(line_key(line))
            try:
                self._solve_anew(start)
            except FAULTS as second:
                self._isam, self._is_lost = Isam(self.config, self.record, start), True
                raise UnsolvableError(f"expected a solution without the last scan, found {second}") from second
            self._anchor()
            words = " ".join(str(error).split()).partition(" Thrown when")[0]
            raise ContradictionError(
                f"expected a least-squares solution of {poses} poses and {lines} lines, found"
                f" {words}: the last scan is taken out again"
            ) from error

    def _solve_anew(self, start: gtsam.Values) -> None:
        isam = Isam(self.config, self.record, Isam(self.config, self.record, start).optimum())
        isam.solve()
        self._isam = isam

    def _last_known(self) -> gtsam.Values:
        """Return where all that was entered is linearised, the predictions that wait entered too."""
        self._isam.enter_poses()
        return self._isam.start()

    def _move_on(self) -> None:
        self._version += 1
        self._belief = None

    def _settled(self) -> Isam:
        """Solve for all that was entered, and make beliefs stale."""
        self._settle()
        self._move_on()
        return self._isam

    def _all_entered(self) -> Isam:
        """Solve for all that was entered, the predictions that wait too."""
        self._settled().enter_poses()
        return self._settled()

    def _rows(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return where the ids stand among the lines shown; raises KeyError for others."""
        return rows_of(self._isam.ids, ids)

    def _anchor(self) -> None:
        shown = [self.record.lines[line].anchor for line in self._isam.ids.tolist()]
        self._anchors = np.array(shown).reshape(-1, 2)
        self._inner_anchors = to_robot(self._anchors, self.record.frame.pose_world)

    def _hide(self, rows: Int[np.ndarray, " m"]) -> None:
        self._isam.hide(rows)
        self._anchor()
