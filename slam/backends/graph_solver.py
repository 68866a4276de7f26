"""iSAM2 over poses and lines: factors go in, estimates and joint covariances come out.

Here the first pose is the origin. What is entered is collected, and handed over when `settle` is called.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, inf

import gtsam
import numpy as np
from jaxtyping import Float, Int

from ..geometry.poses import compose, rotation, wrap
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
from .graph_loose import Loose, wrapped
from .graph_record import Record

MOST_TURN = 1.2
"""Sightings are linearised no farther than this from the prediction, rad: beyond pi/2 a line is seen from behind."""


@dataclass(frozen=True)
class GraphConfig:
    """How closely iSAM2 follows the least-squares solution."""

    relinearise_angle_rad: float = 0.02
    """A pose or a line is linearised anew when it has turned by more than this."""
    relinearise_place_m: float = 0.05
    """And when it has moved by more than this."""
    patience: float = 4.0
    """Linearise anew once scans have corrected the pose by so many of the two above, summed since the last time."""
    passes: int = 5
    """At most so many rounds of linearising anew."""
    wildfire: float = 1e-5
    """Changes smaller than this, m and rad, are not passed on from one part of the map to the next."""
    near: int = 60
    """Lines that one question for a joint covariance may have, to be prepared for in the next steps."""
    loose: float = 0.1
    """A sighting is linearised anew when its line has turned so far that the distance is wrong by this many sigma."""


class Solver:
    """Poses, the lines shown (those whose estimates are asked for, in ascending order of ids) and iSAM2."""

    def __init__(
        self,
        config: GraphConfig,
        record: Record,
        poses: Float[np.ndarray, "p 3"],
        lines: Float[np.ndarray, "n 2"],
        anew: bool = True,
    ) -> None:
        """Make the graph of a record, linearised at `poses` and, in the order of the record, at `lines`.

        With `anew` the sightings are linearised there too, else as the record has it.
        """
        self._config, self._record = config, record
        self._isam = gtsam.ISAM2(_params(config))
        self._factors, self._values, self._removals = gtsam.NonlinearFactorGraph(), gtsam.Values(), list[int]()
        self._entering: list[int] = []
        self._slots: dict[int, int] = {}
        self._loose = Loose(config.loose)
        self._near: set[int] = set()
        self._unrest, self._is_settled = 0.0, False
        self._pose_cov = np.zeros((0, 0))
        self._keys: list[int] = []
        self._reference, self._reference_lines = gtsam.Values(), np.zeros((0, 2))
        self.lines = np.zeros((0, 2))
        """(alpha, r) of the lines shown."""
        self.pose = np.array(poses[0], dtype=np.float64)
        """The last pose entered: predicted until it is settled."""
        self.last = 0
        """Index of that pose."""

        body = np.eye(3)
        body[:2, :2] = rotation(-record.pose_world[2])
        self._enter(prior_factor(body @ record.pose_cov @ body.T))
        self._values.insert(pose_key(0), pose3(self.pose))
        for pose in poses[1:]:
            self.enter_pose(pose)
        for (line, known), at in zip(record.lines.items(), lines, strict=True):
            self._values.insert(line_key(line), gtsam.OrientedPlane3(plane(at[0], at[1])))
            for number in known.sightings:
                epsilon = wrapped(record.seen[number][0] - at[0] + poses[record.seen_from[number], 2])
                self.enter_sighting(line, number, epsilon if anew else record.epsilons[number], float(at[0]))
        shown = [known.shown for known in record.lines.values()]
        self._show([line for line, known in record.lines.items() if known.shown], lines[np.array(shown, dtype=bool)])

    # -- entering ---------------------------------------------------------------------------------------------------

    def enter_poses(self) -> None:
        """Make all motions of the record poses of the graph."""
        for motion in self._record.motions[self.last :]:
            self.enter_pose(compose(self.pose, motion))

    def enter_pose(self, pose: Float[np.ndarray, "3"]) -> None:
        """Enter the next motion of the record; it leads about to `pose`."""
        self.pose, self.last = np.array(pose, dtype=np.float64), self.last + 1
        self._values.insert(pose_key(self.last), pose3(self.pose))
        motion, cov = self._record.motions[self.last - 1], self._record.motion_covs[self.last - 1]
        self._enter(odometry_factor(self.last, motion, cov))

    def enter_lines(self, ids: Sequence[int], lines: Float[np.ndarray, "m 2"]) -> None:
        """Enter new lines; each needs a sighting before `settle`."""
        for line, (alpha, r) in zip(ids, lines.tolist(), strict=True):
            self._values.insert(line_key(line), gtsam.OrientedPlane3(plane(alpha, r)))
        self._show(ids, lines)

    def enter_sighting(self, line: int, number: int, epsilon: float, alpha: float, again: bool = False) -> None:
        """Enter a sighting that departs by `epsilon` from its line, which has the direction `alpha`.

        With `again` it replaces an earlier factor of the same sighting.
        """
        seen = self._record.seen[number]
        epsilon = self._record.epsilons[number] = min(max(epsilon, -MOST_TURN), MOST_TURN)
        self._enter(line_factor(self._record.seen_from[number], line, seen, epsilon), number)
        self._loose.note(line, number, seen, alpha, again)

    def leave_sightings(self, line: int, numbers: Sequence[int]) -> None:
        """Take the factors of a line's sightings out; all must be settled. A line with none left drops out too."""
        for number in numbers:
            self._removals.append(self._slots.pop(number))
            self._loose.leave(line, number)

    def hide(self, rows: Int[np.ndarray, " m"]) -> None:
        """No longer show the lines in these rows."""
        kept = np.ones(len(self._keys), dtype=bool)
        kept[rows] = False
        for row in rows.tolist():
            self._reference.erase(self._keys[row])
        self._keys = [key for key, keep in zip(self._keys, kept, strict=True) if keep]
        self.lines, self._reference_lines = self.lines[kept], self._reference_lines[kept]

    def drop(self, line: int) -> None:
        """Forget a line whose sightings have left."""
        self._loose.drop(line)

    def unsettle(self) -> None:
        """Solve anew at the next occasion, with new points of linearisation: much may have changed."""
        self._unrest, self._is_settled = inf, False

    def _enter(self, factor: gtsam.NonlinearFactor, number: int = -1) -> None:
        self._factors.push_back(factor)
        self._entering.append(number)
        self._is_settled = False

    def _show(self, ids: Sequence[int], lines: Float[np.ndarray, "m 2"]) -> None:
        for line, (alpha, r) in zip(ids, lines.tolist(), strict=True):
            self._reference.insert(line_key(line), gtsam.OrientedPlane3(plane(alpha, r)))
        self._keys += [line_key(line) for line in ids]
        self.lines = np.concatenate([self.lines, lines])
        self._reference_lines = np.concatenate([self._reference_lines, lines])

    # -- solving ----------------------------------------------------------------------------------------------------

    def settle(self) -> None:
        """Solve for what was entered since the last time."""
        if self._is_settled:
            return
        predicted = self.pose
        self._push()
        self.pose = self.pose_at(self.last)
        dx, dy, turn = (self.pose - predicted).tolist()
        self._unrest += hypot(dx, dy) / self._config.relinearise_place_m
        self._unrest += abs(wrapped(turn)) / self._config.relinearise_angle_rad
        if self._tighten() or self._unrest > self._config.patience:
            for _ in range(self._config.passes):
                if not self._push(relinearise=True) + self._tighten():
                    break
            if self._entering:
                self._push()
            self.pose, self._unrest = self.pose_at(self.last), 0.0
        self._loose.calm()
        self._is_settled = True
        self._pose_cov = np.zeros((0, 0))  # Asked of iSAM2 when wanted.
        self._estimate_lines()

    def _push(self, relinearise: bool = False) -> int:
        """Hand over what was collected; return how many variables were linearised anew."""
        last, again = self._order()
        if relinearise:  # iSAM2 would count these as linearised anew, and one round follow another.
            again.clear()
        result = self._isam.update(self._factors, self._values, self._removals, last, None, again, relinearise)
        if self._entering:
            for number, slot in zip(self._entering, result.getNewFactorsIndices(), strict=True):
                if number >= 0:
                    self._slots[number] = slot
            self._factors, self._values, self._entering = gtsam.NonlinearFactorGraph(), gtsam.Values(), []
        self._removals = []
        return result.getVariablesRelinearized()

    def _order(self) -> tuple[gtsam.KeyGroupMap, gtsam.KeyList]:
        """Return what to eliminate last, and what to eliminate again for it.

        The pose now, what this step sees and the lines that were asked for together with the pose come last: the
        next such question is then answered from the top of the tree, four to seven times as fast.
        """
        last, again = gtsam.KeyGroupMap(), gtsam.KeyList()
        last.insert2(pose_key(self.last), 1)
        for key in self._factors.keyVector():
            last.insert2(key, 1)
        for key in sorted(self._near.intersection(self._keys)):
            last.insert2(key, 1)
            again.push_back(key)
        return last, again

    def _tighten(self) -> int:
        """Collect anew the loose sightings of lines that have turned; return how many."""
        count = 0
        for line in self._loose.touched():
            key = line_key(line)
            alpha = float(line_of(self._isam.calculateEstimate([key]).atOrientedPlane3(key))[0])
            for number in self._loose.turned(line, alpha):
                heading = float(self.pose_at(self._record.seen_from[number])[2])
                self._removals.append(self._slots.pop(number))
                self.enter_sighting(line, number, wrapped(self._record.seen[number][0] - alpha + heading), alpha, True)
                count += 1
        return count

    # -- asking -----------------------------------------------------------------------------------------------------

    def pose_at(self, index: int) -> Float[np.ndarray, "3"]:
        """Return the present estimate of one pose."""
        return pose_of(self._isam.calculateEstimatePose3(pose_key(index)))

    def poses(self, linearisation: bool = False) -> Float[np.ndarray, "p 3"]:
        """Return the present estimates of all poses, or the points at which they are linearised."""
        values = self._all(linearisation)
        return np.array([pose_of(values.atPose3(pose_key(k))) for k in range(self.last + 1)])

    def all_lines(self, linearisation: bool = False) -> Float[np.ndarray, "n 2"]:
        """Return the present estimates of all lines of the record, shown or not, or where they are linearised."""
        values = self._all(linearisation)
        lines = [line_of(values.atOrientedPlane3(line_key(line))) for line in self._record.lines]
        return np.array(lines).reshape(-1, 2)

    def _all(self, linearisation: bool) -> gtsam.Values:
        self.settle()
        return self._isam.getLinearizationPoint() if linearisation else self._isam.calculateBestEstimate()

    def _estimate_lines(self) -> None:
        """Estimate all lines shown without a loop over them: from how far each is from where it was entered."""
        if self._keys:
            moved = self._reference.localCoordinates(self._isam.calculateEstimate(self._keys)).vector(self._keys)
            self.lines = self._reference_lines - moved.reshape(-1, 3)[:, LINE_ROWS]
            self.lines[:, 0] = wrap(self.lines[:, 0])

    def pose_cov(self) -> Float[np.ndarray, "3 3"]:
        """Return the covariance of the last pose, body frame."""
        if not len(self._pose_cov):
            found = self._isam.marginalCovariance(pose_key(self.last))
            self._pose_cov = found[np.ix_(POSE_ROWS, POSE_ROWS)]
        return self._pose_cov

    def joint_cov(self, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "s s"]:
        """Return the covariance of the last pose (body frame) and the lines (alpha, r) in these rows, by one query."""
        if not len(rows):
            return self.pose_cov().copy()
        keys = [self._keys[row] for row in rows.tolist()]
        if len(keys) <= self._config.near:
            self._near = set(keys)
        found = self._isam.jointMarginalCovariance([pose_key(self.last), *keys]).fullMatrix()
        lines = 6 + 3 * np.arange(len(keys))[:, None] + np.array(LINE_ROWS)
        index = np.concatenate([POSE_ROWS, lines.ravel()])
        cov = found[np.ix_(index, index)]
        cov[:3, 3:] *= -1.0
        cov[3:, :3] *= -1.0
        return cov


def optimise(
    record: Record, poses: Float[np.ndarray, "p 3"], lines: Float[np.ndarray, "n 2"], rounds: int = 10
) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, "n 2"]]:
    """Return all poses and lines at the least-squares optimum (Levenberg-Marquardt), from a first guess.

    Sightings are linearised anew at each optimum, at most `rounds` times; after the second it hardly moves.
    """
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-14)
    params.setAbsoluteErrorTol(1e-14)
    for _ in range(rounds):
        whole = Solver(GraphConfig(), record, poses, lines)
        optimum = gtsam.LevenbergMarquardtOptimizer(whole._factors, whole._values, params).optimize()
        before = poses, lines
        poses = np.array([pose_of(optimum.atPose3(pose_key(k))) for k in range(len(poses))])
        lines = np.array([line_of(optimum.atOrientedPlane3(line_key(line))) for line in record.lines]).reshape(-1, 2)
        if np.allclose(poses, before[0], rtol=0, atol=1e-9) and np.allclose(lines, before[1], rtol=0, atol=1e-9):
            break
    return poses, lines


def _params(config: GraphConfig) -> gtsam.ISAM2Params:
    params = gtsam.ISAM2Params()
    params.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(config.wildfire))
    params.relinearizeSkip = 1 << 30  # Only when `settle` asks for it.
    angle, place = config.relinearise_angle_rad, config.relinearise_place_m
    thresholds = gtsam.ISAM2ThresholdMap()
    thresholds.insert(("x", np.array([angle, 1.0, 1.0, 1.0, place, place])))
    thresholds.insert(("l", np.array([angle, 1.0, place])))
    params.setRelinearizeThreshold(thresholds)
    params.findUnusedFactorSlots = True
    return params
