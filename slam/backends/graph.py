"""The stochastic map as a factor graph: every pose kept and relinearised, solved step by step (iSAM2).

Inside, the first pose is the origin, so that no answer depends on where the world has its own. The calls of
one step are collected and handed to iSAM2 together, when a belief is next asked for; a prediction alone is
propagated without it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, inf, sin

import gtsam
import numpy as np
from jaxtyping import Float, Int

from ..backend import Belief, Joint, Observations, StaleBeliefError
from ..geometry.lines import directions, normals
from ..geometry.poses import compose, rotation, to_robot, to_world, wrap
from ..models import grow, move
from ..robot import Odometry
from .graph_factors import (
    LINE_ROWS,
    POSE_ROWS,
    line_factor,
    line_key,
    line_of,
    odometry_factor,
    plane,
    pose3,
    pose_key,
    pose_of,
    prior_factor,
)
from .graph_record import LineRecord, Record

MOST_TURN = 1.2
"""Sightings are linearised no farther than this from the prediction, rad: beyond pi/2 a line is seen from behind."""


@dataclass(frozen=True)
class GraphConfig:
    """How closely iSAM2 follows the least-squares solution."""

    relinearise_angle_rad: float = 0.01
    """A pose or a line is linearised anew when it has turned by more than this."""
    relinearise_place_m: float = 0.02
    """And when it has moved by more than this."""
    wildfire: float = 1e-5
    """Changes smaller than this, m and rad, are not passed on from one part of the map to the next."""
    patience: float = 4.0
    """Linearise anew once scans have corrected the pose by so many of the two above, summed since the last time."""
    passes: int = 5
    """At most so many rounds of linearising anew."""
    loose: float = 0.1
    """A sighting is linearised anew when its line has turned so far that the distance is wrong by this many sigma."""


@dataclass
class _Loose:
    """Sightings of one line taken while its direction was poorly known."""

    information: float
    """Of the line's direction, 1/rad^2."""
    alpha: float
    """Direction of the line when they were last linearised."""
    turn: float
    """How far the line may turn before they are linearised anew, rad."""
    numbers: list[int]


class Graph:
    """Incremental smoothing of all poses and lines; a joint back end, so each sighting counts once."""

    def __init__(
        self,
        pose_world: Float[np.ndarray, "3"],
        pose_cov: Float[np.ndarray, "3 3"],
        config: GraphConfig = GraphConfig(),
    ) -> None:
        """Start at a pose with its covariance and an empty map."""
        self._config = config
        self._version = 0
        self._belief: Belief | None = None
        self._pose_cov: np.ndarray = np.zeros((0, 0))
        self._record = Record(np.array(pose_world, dtype=np.float64), np.array(pose_cov, dtype=np.float64))
        self._build({}, {})

    # -- the Backend protocol ---------------------------------------------------------------------------------------

    @property
    def belief(self) -> Belief:
        """The estimate now."""
        if self._belief is None:
            self._belief = self._believe()
        return self._belief

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by what the wheels report; it becomes a pose of the graph with the next scan."""
        self._move_on()
        poses = len(self._record.motions)
        if np.any(odometry.motion) or np.any(odometry.cov):
            self._record.motions.append(np.array(odometry.motion, dtype=np.float64))
            self._record.motion_covs.append(np.array(odometry.cov, dtype=np.float64))
            poses += 1
        self._record.poses_of_steps.append(poses)

    def update(self, first: Observations, second: Observations) -> None:
        """Take in one scan's matches (`second`; a joint back end has no use for `first`)."""
        if not len(second.ids):
            return
        rows = self._rows(second.ids)
        self._move_on()
        self._enter_poses()
        alpha = self._lines[rows, 0]
        epsilon = wrap(second.lines[:, 0] - alpha + self._pose[2])
        cov = second.cov
        order = np.lexsort((second.lines[:, 1], second.lines[:, 0], second.ids))
        for k in order.tolist():
            line = int(second.ids[k])
            seen = (*second.lines[k].tolist(), float(cov[k, 0, 0]), float(cov[k, 0, 1]), float(cov[k, 1, 1]))
            self._enter_sighting(line, self._record.add(self._last, line, seen), float(epsilon[k]), float(alpha[k]))

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Add lines seen in the robot frame and return their ids; they are anchored where they were seen."""
        self._settle()
        self._move_on()
        self._enter_poses()
        new = grow(self._pose, lines, centres, at_wall=False)
        anchors = to_world(to_world(centres, self._pose), self._record.pose_world)
        ids = np.arange(self._record.next_id, self._record.next_id + len(lines))
        self._record.next_id += len(lines)
        for k, line in enumerate(ids.tolist()):
            self._record.lines[line] = LineRecord(anchors[k])
            alpha, r = new.means[k].tolist()
            self._values.insert(line_key(line), gtsam.OrientedPlane3(plane(alpha, r)))
            self._reference.insert(line_key(line), gtsam.OrientedPlane3(plane(alpha, r)))
            seen = (*lines[k].tolist(), float(cov[k, 0, 0]), float(cov[k, 0, 1]), float(cov[k, 1, 1]))
            self._enter_sighting(line, self._record.add(self._last, line, seen), 0.0, alpha)
        self._show(
            np.concatenate([self._ids, ids]),
            np.concatenate([self._anchors, anchors]),
            np.concatenate([self._lines, new.means]),
            np.concatenate([self._reference_lines, new.means]),
        )
        return ids

    def merge(self, keep: int, drop: int) -> None:
        """Make two lines one: the sightings of `drop` become sightings of `keep`."""
        keep_row, drop_row = self._rows([keep, drop])
        self._settle()
        self._move_on()
        poses: dict[int, np.ndarray] = {}
        moved = self._record.lines[drop].sightings
        self._leave_sightings(moved)
        alpha = float(self._lines[keep_row, 0])
        for number in moved:
            index = self._record.seen_from[number]
            if index not in poses:
                poses[index] = self._estimate_pose(index)
            epsilon = _wrapped(self._record.seen[number][0] - alpha + poses[index][2])
            self._enter_sighting(keep, number, epsilon, alpha)
        self._record.lines[keep].sightings.extend(moved)
        self._hide(np.array([drop_row]))
        self._drop(drop)
        self._unrest = inf

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map.

        What their sightings said of the poses stays, as when a filter forgets a line: lines seen more than once are
        no longer shown, but remain in the graph. To undo a wrong line, see `retract`.
        """
        rows = self._rows(ids)
        self._settle()
        self._move_on()
        for line in map(int, ids):
            if len(self._record.lines[line].sightings) > 1:
                self._record.lines[line].shown = False
            else:  # One sighting of a line that nothing else saw says nothing of the rest.
                self._leave_sightings(self._record.lines[line].sightings)
                self._drop(line)
        self._hide(rows)

    # -- what only a graph can do -----------------------------------------------------------------------------------

    def retract(self, ids: Sequence[int]) -> None:
        """Take lines out with all that was ever seen of them, as if they had not been matched at all."""
        rows = self._rows(ids)
        self._settle()
        self._move_on()
        for line in map(int, ids):
            self._leave_sightings(self._record.lines[line].sightings)
            self._drop(line)
        self._hide(rows)
        self._is_settled, self._unrest = False, inf

    def retract_sightings(self, numbers: Sequence[int]) -> None:
        """Undo wrong matches, by the numbers that `sightings_of` gives; a line without any sighting left is removed."""
        owners = {number: line for line, record in self._record.lines.items() for number in record.sightings}
        if unknown := [number for number in numbers if number not in owners]:
            raise KeyError(f"expected numbers of sightings that hold, found {unknown}")
        self._settle()
        self._move_on()
        self._leave_sightings(numbers)
        for number in numbers:
            line = owners[number]
            self._record.lines[line].sightings.remove(number)
            if not self._record.lines[line].sightings:
                if self._record.lines[line].shown:
                    self._hide(self._rows([line]))
                self._drop(line)
        self._is_settled, self._unrest = False, inf

    def sightings_of(self, line: int) -> Int[np.ndarray, "m 2"]:
        """Return rows (number of the sighting, step from which it was seen) of a line, oldest first."""
        self._rows([line])
        numbers = np.array(sorted(self._record.lines[line].sightings), dtype=np.int64)
        poses = np.array(self._record.seen_from, dtype=np.int64)[numbers]
        return np.stack([numbers, np.searchsorted(self._record.poses_of_steps, poses)], axis=-1)

    def trajectory(self) -> Float[np.ndarray, "n 3"]:
        """Return the present estimate of the pose at the start and after every prediction, world frame (smoothed)."""
        self._settle()
        self._move_on()
        self._enter_poses()
        self._settle()
        estimate = self._isam.calculateBestEstimate()
        poses = [pose_of(estimate.atPose3(pose_key(k))) for k in range(self._last + 1)]
        return np.array([compose(self._record.pose_world, poses[k]) for k in self._record.poses_of_steps])

    def arrays(self) -> dict[str, np.ndarray]:
        """Return prior, odometry, sightings and the points of linearisation as plain arrays, for `numpy.savez`."""
        self._settle()
        self._move_on()
        self._enter_poses()
        self._settle()
        values = self._isam.getLinearizationPoint()
        poses = [pose_of(values.atPose3(pose_key(k))) for k in range(self._last + 1)]
        lines = [line_of(values.atOrientedPlane3(line_key(line))) for line in self._record.lines]
        return {**self._record.arrays(), "poses": np.array(poses), "lines": np.array(lines).reshape(-1, 2)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, np.ndarray], config: GraphConfig = GraphConfig()) -> "Graph":
        """Return the graph of which `arrays` were made; raises ValueError for another format."""
        record = Record.from_arrays(arrays)
        graph = cls(record.pose_world, record.pose_cov, config)
        graph._record = record
        graph._build(dict(enumerate(arrays["poses"])), dict(zip(record.lines, arrays["lines"], strict=True)))
        return graph

    # -- from calls to factors --------------------------------------------------------------------------------------

    def _build(self, poses: Mapping[int, np.ndarray], lines: Mapping[int, np.ndarray]) -> None:
        """Make the graph of the record anew, linearised at these poses and lines (inner frame)."""
        record = self._record
        self._move_on()
        self._isam = gtsam.ISAM2(_isam_params(self._config))
        self._factors, self._values, self._removals = gtsam.NonlinearFactorGraph(), gtsam.Values(), list[int]()
        self._entering: list[int] = []
        self._slots: dict[int, int] = {}
        self._loose: dict[int, _Loose] = {}
        self._touched: set[int] = set()
        self._last = 0
        self._is_settled = False
        self._unrest = 0.0
        body = np.eye(3)
        body[:2, :2] = rotation(-record.pose_world[2])
        self._factors.push_back(prior_factor(body @ record.pose_cov @ body.T))
        self._entering.append(-1)
        self._pose = np.array(poses.get(0, np.zeros(3)), dtype=np.float64)
        self._values.insert(pose_key(0), pose3(self._pose))
        self._enter_poses(poses)
        self._reference = gtsam.Values()
        for line, (alpha, r) in lines.items():
            self._values.insert(line_key(line), gtsam.OrientedPlane3(plane(alpha, r)))
        for number, line in record.sightings():
            index, alpha = record.seen_from[number], float(lines[line][0])
            self._enter_sighting(line, number, _wrapped(record.seen[number][0] - alpha + poses[index][2]), alpha)
        shown = [line for line, at in record.lines.items() if at.shown]
        for line in shown:
            self._reference.insert(line_key(line), gtsam.OrientedPlane3(plane(*lines[line])))
        means = np.array([lines[line] for line in shown], dtype=np.float64).reshape(-1, 2)
        anchors = np.array([record.lines[line].anchor for line in shown]).reshape(-1, 2)
        self._show(np.array(shown, dtype=np.int64), anchors, means, means)
        self._settle()

    def _move_on(self) -> None:
        self._version += 1
        self._belief = None

    def _rows(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return where the ids stand among the lines shown; raises KeyError for others."""
        wanted = np.asarray(ids, dtype=np.int64)
        rows = np.searchsorted(self._ids, wanted)
        found = rows < len(self._ids)
        found[found] = self._ids[rows[found]] == wanted[found]
        if not np.all(found):
            raise KeyError(f"expected ids of lines in the map, found {wanted[~found].tolist()}")
        return rows

    def _show(
        self,
        ids: Int[np.ndarray, " n"],
        anchors: Float[np.ndarray, "n 2"],
        lines: Float[np.ndarray, "n 2"],
        reference: Float[np.ndarray, "n 2"],
    ) -> None:
        """Set what a belief shows: ids, anchors (world), lines and the lines as first entered (inner frame)."""
        self._ids, self._anchors, self._lines, self._reference_lines = ids, anchors, lines, reference
        self._keys = [line_key(line) for line in ids.tolist()]
        self._inner_anchors = to_robot(anchors, self._record.pose_world)

    def _hide(self, rows: Int[np.ndarray, " m"]) -> None:
        kept = np.ones(len(self._ids), dtype=bool)
        kept[rows] = False
        for row in rows.tolist():
            self._reference.erase(self._keys[row])
        self._show(self._ids[kept], self._anchors[kept], self._lines[kept], self._reference_lines[kept])

    def _drop(self, line: int) -> None:
        """Forget all about a line whose sightings have left it: iSAM2 drops variables without factors by itself."""
        del self._record.lines[line]
        self._loose.pop(line, None)
        self._touched.discard(line)

    def _enter_poses(self, poses: Mapping[int, np.ndarray] | None = None) -> None:
        """Make the predictions that wait poses of the graph."""
        record = self._record
        for index in range(self._last + 1, len(record.motions) + 1):
            self._pose = poses[index] if poses else compose(self._pose, record.motions[index - 1])
            self._values.insert(pose_key(index), pose3(self._pose))
            self._factors.push_back(odometry_factor(index, record.motions[index - 1], record.motion_covs[index - 1]))
            self._entering.append(-1)
            self._last, self._is_settled = index, False

    def _enter_sighting(self, line: int, number: int, epsilon: float, alpha: float, again: bool = False) -> None:
        """Add the factor of a sighting that departs by `epsilon` from the line's present direction `alpha`.

        With `again` it replaces an earlier factor of the same sighting.
        """
        seen = self._record.seen[number]
        epsilon = min(max(epsilon, -MOST_TURN), MOST_TURN)
        self._factors.push_back(line_factor(self._record.seen_from[number], line, seen, epsilon))
        self._entering.append(number)
        self._is_settled = False
        self._note_loose(line, number, alpha, again)

    def _leave_sightings(self, numbers: Sequence[int]) -> None:
        """Take out the factors of sightings; the graph must be settled."""
        self._removals.extend(self._slots.pop(number) for number in numbers)
        for number in numbers:
            for loose in self._loose.values():
                if number in loose.numbers:
                    loose.numbers.remove(number)

    # -- from factors to estimates ----------------------------------------------------------------------------------

    def _settle(self) -> None:
        """Solve for what was entered since the last time."""
        if self._is_settled:
            return
        predicted = self._pose
        self._push()
        self._correct(predicted)
        anew = self._tighten()
        if anew or self._unrest > self._config.patience:
            for _ in range(self._config.passes):
                if not self._push(relinearise=True) + self._tighten():
                    break
            self._pose = self._estimate_pose(self._last)
            self._unrest = 0.0
        self._touched.clear()
        self._is_settled = True
        self._pose_cov = np.zeros((0, 0))  # Asked of iSAM2 only when wanted.
        self._lines = self._estimate_lines()

    def _correct(self, predicted: Float[np.ndarray, "3"]) -> None:
        """Take the pose that iSAM2 found, and note how far it is from the one predicted."""
        self._pose = self._estimate_pose(self._last)
        dx, dy, turn = (self._pose - predicted).tolist()
        self._unrest += hypot(dx, dy) / self._config.relinearise_place_m
        self._unrest += abs(_wrapped(turn)) / self._config.relinearise_angle_rad

    def _push(self, relinearise: bool = False) -> int:
        """Hand over what was collected; return how many variables were linearised anew."""
        result = self._isam.update(self._factors, self._values, self._removals, None, None, None, relinearise)
        if self._entering:
            for number, slot in zip(self._entering, result.getNewFactorsIndices(), strict=True):
                if number >= 0:
                    self._slots[number] = slot
            self._factors, self._values = gtsam.NonlinearFactorGraph(), gtsam.Values()
            self._entering = []
        self._removals = []
        return result.getVariablesRelinearized()

    def _estimate_pose(self, index: int) -> Float[np.ndarray, "3"]:
        return pose_of(self._isam.calculateEstimatePose3(pose_key(index)))

    def _estimate_lines(self) -> Float[np.ndarray, "n 2"]:
        """Return all lines shown, inner frame, without a loop over them: how far each is from where it was entered."""
        if not self._keys:
            return np.zeros((0, 2))
        moved = self._reference.localCoordinates(self._isam.calculateEstimate(self._keys)).vector(self._keys)
        lines = self._reference_lines - moved.reshape(-1, 3)[:, LINE_ROWS]
        lines[:, 0] = wrap(lines[:, 0])
        return lines

    def _note_loose(self, line: int, number: int, alpha: float, again: bool) -> None:
        """Keep in mind a sighting whose line may still turn so far that the factor no longer holds."""
        _, r, along, cross, across = self._record.seen[number]
        sigma = np.sqrt(across - cross * cross / along)
        turn = float(np.sqrt(2.0 * self._config.loose * sigma / max(abs(r), 1e-3)))
        loose = self._loose.get(line)
        if loose is None:
            loose = self._loose[line] = _Loose(0.0, alpha, turn, [])
        loose.information += 0.0 if again else 1.0 / along
        if 9.0 / loose.information > turn * turn:
            loose.turn = min(loose.turn, turn) if loose.numbers else turn
            loose.numbers.append(number)
            self._touched.add(line)
        elif loose.numbers:
            self._touched.add(line)

    def _tighten(self) -> int:
        """Linearise anew the loose sightings of lines that have turned; return how many."""
        count = 0
        for line in sorted(self._touched):
            loose = self._loose[line]
            if not loose.numbers:
                continue
            alpha = float(line_of(self._isam.calculateEstimate([line_key(line)]).atOrientedPlane3(line_key(line)))[0])
            if abs(_wrapped(alpha - loose.alpha)) > loose.turn:
                numbers, loose.numbers, loose.alpha = loose.numbers, [], alpha
                count += len(numbers)
                for number in numbers:
                    self._removals.append(self._slots.pop(number))
                    heading = float(self._estimate_pose(self._record.seen_from[number])[2])
                    epsilon = _wrapped(self._record.seen[number][0] - alpha + heading)
                    self._enter_sighting(line, number, epsilon, alpha, again=True)
        return count

    def _believe(self) -> Belief:
        self._settle()
        version, ids, anchors = self._version, self._ids, self._anchors
        if not len(self._pose_cov):
            cov = self._isam.marginalCovariance(pose_key(self._last))
            self._pose_cov = _symmetric(cov[np.ix_(POSE_ROWS, POSE_ROWS)])
        ahead = _Ahead(compose(self._record.pose_world, self._pose))
        for index in range(self._last, len(self._record.motions)):
            ahead.move(self._record.motions[index], self._record.motion_covs[index])
        pose_cov = ahead.pose_cov(self._pose_cov)
        means = self._lines.copy()
        means[:, 0] = wrap(means[:, 0] + self._record.pose_world[2])
        means[:, 1] -= np.sum(normals(self._lines[:, 0]) * self._inner_anchors, axis=-1)
        asked: list[tuple[Int[np.ndarray, " m"], Float[np.ndarray, "s s"]]] = []

        def query(wanted: Int[np.ndarray, " m"]) -> Joint:
            if version != self._version:
                raise StaleBeliefError("expected a belief of the present step, found one whose back end has moved on")
            rows = belief.rows(wanted)
            mean = np.concatenate([belief.pose_world, belief.means[rows].ravel()])
            if not asked or not np.all(np.isin(rows, asked[0][0])):
                cov = ahead.joint_cov(self._joint(rows))
                cov[:3, :3] = pose_cov
                asked[:] = [(rows, cov)]
            rows_known, cov = asked[0]
            sorter = np.argsort(rows_known)
            at = sorter[np.searchsorted(rows_known, rows, sorter=sorter)]
            index = np.concatenate([np.arange(3), (3 + 2 * at[:, None] + np.arange(2)).ravel()])
            return Joint(mean, cov[np.ix_(index, index)], anchors[rows])

        belief = Belief(ahead.pose_world, pose_cov, ids, anchors, means, query)
        return belief

    def _joint(self, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "s s"]:
        """Return the covariance of the last pose (body frame) and these lines (alpha, d), from one query."""
        m = len(rows)
        if not m:
            return self._pose_cov.copy()
        found = self._isam.jointMarginalCovariance(
            [pose_key(self._last), *(self._keys[row] for row in rows.tolist())]
        ).fullMatrix()
        lines = 6 + 3 * np.arange(m)[:, None] + np.array(LINE_ROWS)
        index = np.concatenate([POSE_ROWS, lines.ravel()])
        cov = found[np.ix_(index, index)]
        cov[:3, 3:] *= -1.0
        cov[3:, :3] *= -1.0
        # d = r - n(alpha)·c, so dd = dr - (t·c) dalpha.
        lever = np.sum(directions(self._lines[rows, 0]) * self._inner_anchors[rows], axis=-1)
        cov[4::2] -= lever[:, None] * cov[3::2]
        cov[:, 4::2] -= lever * cov[:, 3::2]
        return _symmetric(cov)


class _Ahead:
    """A pose some predictions ahead of the last pose of the graph."""

    def __init__(self, pose_world: Float[np.ndarray, "3"]) -> None:
        self.pose_world = pose_world
        self._F = np.eye(3)
        self._F[:2, :2] = rotation(pose_world[2])
        self._Q = np.zeros((3, 3))

    def move(self, motion: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> None:
        step = move(self.pose_world, motion)
        self.pose_world = step.pose_world
        self._F = step.F @ self._F
        self._Q = step.F @ self._Q @ step.F.T + step.W @ cov @ step.W.T

    def pose_cov(self, cov_body: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
        return _symmetric(self._F @ cov_body @ self._F.T + self._Q)

    def joint_cov(self, cov: Float[np.ndarray, "s s"]) -> Float[np.ndarray, "s s"]:
        cov[:3] = self._F @ cov[:3]
        cov[3:, :3] = cov[:3, 3:].T
        return cov


def _isam_params(config: GraphConfig) -> gtsam.ISAM2Params:
    params = gtsam.ISAM2Params()
    params.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(config.wildfire))
    params.relinearizeSkip = 1 << 30  # Only when `_settle` asks for it.
    angle, place = config.relinearise_angle_rad, config.relinearise_place_m
    thresholds = gtsam.ISAM2ThresholdMap()
    thresholds.insert(("x", np.array([angle, 1.0, 1.0, 1.0, place, place])))
    thresholds.insert(("l", np.array([angle, 1.0, place])))
    params.setRelinearizeThreshold(thresholds)
    params.findUnusedFactorSlots = True
    return params


def _symmetric(cov: Float[np.ndarray, "s s"]) -> Float[np.ndarray, "s s"]:
    return 0.5 * (cov + cov.T)


def _wrapped(angle: float) -> float:
    return atan2(sin(angle), cos(angle))
