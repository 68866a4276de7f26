"""iSAM2 over poses and lines: what is entered is collected, handed over when solved for, then questions are answered.

Here the first pose is the origin.
"""

from collections.abc import Sequence
from functools import lru_cache

import gtsam
import numpy as np
from jaxtyping import Float, Int
from scipy.special import chdtri

from ...estimation.backend import columns_of
from ...geometry.poses import compose, wrap
from .ahead import Ahead
from .config import GraphConfig
from .factors import (
    LINE_ROWS,
    POSE_BLOCK,
    POSE_ROWS,
    line_factors,
    line_key,
    line_of,
    odometry_factor,
    origin_factor,
    plane,
    pose3,
    pose_key,
    pose_of,
)  # fmt: skip
from .record import Observation, Record


class DivergedError(RuntimeError):
    """A solution is not finite, or is where the prediction rules it out: the next one would be linearised nowhere."""


class Isam:
    """The poses, the lines shown (those whose estimates are asked for, in ascending order of ids) and iSAM2."""

    def __init__(self, config: GraphConfig, record: Record, values: gtsam.Values | None = None) -> None:
        """Make the graph of a record, linearised at `values`; without them the record has nothing but a start."""
        self._config, self._record = config, record
        self._isam = gtsam.ISAM2(_params(config))
        self._thresholds = np.array([config.relinearise_angle_rad, config.relinearise_place_m])
        self._beyond = float(chdtri(3, config.diverged_chance))
        self._factors, self._values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self._entering: list[tuple[int, Observation]] = []
        self._removals: list[int] = []
        self._near: list[int] = []
        self._known: list[int] = []
        self._cov = np.zeros((0, 0))
        self._keys: list[int] = []
        self.ids = np.zeros(0, dtype=np.int64)
        """The lines shown."""
        self.lines = np.zeros((0, 2))
        """Their (alpha, r)."""
        self._linear = np.zeros((0, 2))
        self._off = np.zeros(0)
        self.last = 0
        """Index of the last pose entered."""
        self.pose = np.zeros(3)
        """That pose: predicted until it is solved for."""
        self._solved = -1, self.pose
        self._factors.push_back(origin_factor())
        self._values.insert(pose_key(0), pose3(self.pose))
        if values is None:
            return
        self._values = gtsam.Values(values)
        for index, odometry in enumerate(record.motions, 1):
            self._factors.push_back(odometry_factor(index, odometry))
        self.last, self.pose = len(record.motions), pose_of(values.atPose3(pose_key(len(record.motions))))
        for line, known in record.lines.items():
            for observation in known.observations:
                self.enter(line, observation)
        self._show(list(record.lines), lines_of(values, list(record.lines)))
        self.hide(np.flatnonzero([not known.shown for known in record.lines.values()]))

    # -- entering ---------------------------------------------------------------------------------------------------

    @property
    def is_waiting(self) -> bool:
        """Whether there is something to solve for."""
        return bool(self._factors.size() or self._removals)

    @property
    def is_new(self) -> bool:
        """Whether the last pose is still to be solved for."""
        return bool(self._values.exists(pose_key(self.last)))

    def enter_poses(self) -> None:
        """Make all motions of the record poses of the graph."""
        for odometry in self._record.motions[self.last :]:
            self.last, self.pose = self.last + 1, compose(self.pose, odometry.motion)
            self._values.insert(pose_key(self.last), pose3(self.pose))
            self._factors.push_back(odometry_factor(self.last, odometry))

    def move(self, pose: Float[np.ndarray, "3"]) -> None:
        """Linearise the last pose elsewhere; it must be new."""
        self.pose = pose
        self._values.update(pose_key(self.last), pose3(pose))

    def enter_lines(self, ids: Sequence[int], lines: Float[np.ndarray, "m 2"]) -> None:
        """Enter new lines, to be linearised there."""
        for line, (alpha, r) in zip(ids, lines.tolist(), strict=True):
            self._values.insert(line_key(line), gtsam.OrientedPlane3(plane(alpha, r)))
        self._show(ids, lines)

    def enter(self, line: int, observation: Observation) -> None:
        """Enter an observation of a line."""
        self._entering.append((self._factors.size(), observation))
        for factor in line_factors(line, observation):
            self._factors.push_back(factor)

    def leave(self, observations: Sequence[Observation]) -> None:
        """Take observations out; all must be solved for. A line with none left drops out too."""
        self._removals += [slot for observation in observations for slot in observation.slots]

    def hide(self, rows: Int[np.ndarray, " m"]) -> None:
        """No longer show the lines in these rows."""
        self.ids, self._off = np.delete(self.ids, rows), np.delete(self._off, rows)
        self.lines, self._linear = np.delete(self.lines, rows, axis=0), np.delete(self._linear, rows, axis=0)
        self._keys = [line_key(line) for line in self.ids.tolist()]
        self._near = [key for key in self._near if key in self._keys]

    def _show(self, ids: Sequence[int], lines: Float[np.ndarray, "m 2"]) -> None:
        self.ids = np.concatenate([self.ids, np.asarray(ids, dtype=np.int64)])
        self._keys += [line_key(line) for line in ids]
        self.lines, self._linear = np.concatenate([self.lines, lines]), np.concatenate([self._linear, lines])
        self._off = np.concatenate([self._off, np.zeros(len(ids))])

    # -- solving ----------------------------------------------------------------------------------------------------

    def solve(self) -> None:
        """Solve for what was entered, again while a line is far from where it is linearised.

        Raises DivergedError for a solution that the prediction rules out, and what GTSAM raises: RuntimeError,
        ValueError or IndexError.
        """
        index, pose = self._solved
        expected = Ahead(pose, self._record.motions[max(index, 0) : self.last])
        cov = expected.cov(self.pose_cov(), self.lines[:0], self.lines[:0]) if index >= 0 else None
        for _ in range(self._config.passes):
            self._push()
            self._read()
            if cov is not None:
                self._hold_pose(expected.pose, cov)
            if self._off.max(initial=0.0) <= self._config.closure:
                break
        self._solved = self.last, self.pose

    def _push(self) -> None:
        """Hand over what was collected; what is astray is linearised anew.

        The pose now, what this step sees and the lines that were asked for together with the pose are eliminated
        last: the next such question is then answered from the top of the tree, four to seven times as fast.
        """
        top, again = gtsam.KeyGroupMap(), gtsam.KeyList()
        for key in (pose_key(self.last), *self._factors.keyVector(), *self._near):
            top.insert2(key, 1)
        for key in self._near:
            again.push_back(key)
        anew = bool(np.any(self._off > 1.0))
        result = self._isam.update(self._factors, self._values, self._removals, top, None, again, anew)
        slots = result.getNewFactorsIndices()
        for at, observation in self._entering:
            observation.slots = slots[at], slots[at + 1]
        self._factors, self._values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self._entering, self._removals, self._known, self._cov = [], [], [], np.zeros((0, 0))

    def _read(self) -> None:
        """Read the pose and the lines; raises DivergedError for lines that turn too far."""
        self.pose, moved = self._estimates()
        if not self._keys:
            return
        astray = np.flatnonzero(self._off > 1.0)
        if len(astray):
            self._linear[astray] = lines_of(self._isam.getLinearizationPoint(), self.ids[astray].tolist())
        self.lines = self._linear + moved
        self.lines[:, 0] = wrap(self.lines[:, 0])
        self._off = np.max(np.abs(moved) / self._thresholds, axis=1)
        if not np.abs(moved[:, 0]).max() <= self._config.most_turn_rad or not np.isfinite(moved[:, 1]).all():
            raise DivergedError(f"expected lines that turn by less than {self._config.most_turn_rad:g} rad at once")

    def _estimates(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "n 2"]]:
        """Return the last pose, and by how much the lines (alpha, r) are from where they are linearised."""
        pose = pose_of(self._isam.calculateEstimatePose3(pose_key(self.last)))
        return pose, -self._isam.getDelta().vector(self._keys).reshape(-1, 3)[:, LINE_ROWS]

    def _hold_pose(self, expected: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> None:
        """Hold the pose against its prediction; raises DivergedError where both cannot be.

        Within a few thresholds of linearisation any solution is as good as its factors, whatever was expected.
        """
        off = self.pose - expected
        off[2] = wrap(off[2])
        beyond = float(off @ np.linalg.solve(cov + np.diag(self._thresholds[[1, 1, 0]] ** 2), off))
        if not beyond <= self._beyond:
            raise DivergedError(
                f"expected a pose within chi-square {self._beyond:.0f} of its prediction, found {beyond:.3g}"
            )

    # -- asking -----------------------------------------------------------------------------------------------------

    def start(self) -> gtsam.Values:
        """Return the points of linearisation of all that was entered, solved for or not."""
        values = gtsam.Values(self._isam.getLinearizationPoint())
        values.insert_or_assign(self._values)
        return values

    def values(self) -> gtsam.Values:
        """Return the present estimates of everything."""
        return self._isam.calculateBestEstimate()

    def optimum(self) -> gtsam.Values:
        """Return the least-squares optimum of all that waits, from its values (Levenberg-Marquardt)."""
        params = gtsam.LevenbergMarquardtParams()
        params.setRelativeErrorTol(1e-14)
        params.setAbsoluteErrorTol(1e-14)
        return gtsam.LevenbergMarquardtOptimizer(self._factors, self._values, params).optimize()

    def pose_cov(self) -> Float[np.ndarray, "3 3"]:
        """Return the covariance of the last pose that is solved for, body frame."""
        if not len(self._cov):
            self._ask(self._near)
        return self._cov[:3, :3]

    def joint_cov(self, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "s s"]:
        """Return the covariance of that pose (body frame) and the lines (alpha, r) in these rows."""
        keys = [self._keys[row] for row in rows.tolist()]
        if not len(self._cov) or not set(keys) <= set(self._known):
            self._ask(sorted(keys))
        if len(keys) <= self._config.near:
            self._near = sorted(keys)
        columns = columns_of(np.searchsorted(self._known, keys))
        return self._cov[columns[:, None], columns]

    def pair_cov(self, first: int, second: int) -> Float[np.ndarray, "6 6"]:
        """Return the covariance of two poses, each in its body frame."""
        if first == second:
            return np.tile(self._isam.marginalCovariance(pose_key(first))[POSE_BLOCK], (2, 2))
        found = self._isam.jointMarginalCovariance([pose_key(first), pose_key(second)]).fullMatrix()
        rows = np.concatenate([POSE_ROWS, 6 + np.array(POSE_ROWS)])
        return np.asarray(found[np.ix_(rows, rows)])

    def _ask(self, keys: list[int]) -> None:
        """Ask iSAM2 for the covariance of the pose and lines, and keep it until the next solution."""
        rows, sign = _rows(len(keys))
        key = pose_key(self._solved[0])
        found = (
            self._isam.jointMarginalCovariance([key, *keys]).fullMatrix()
            if keys
            else self._isam.marginalCovariance(key)
        )
        self._known, self._cov = keys, found[rows[:, None], rows] * sign


def poses_of(values: gtsam.Values, count: int) -> Float[np.ndarray, "p 3"]:
    """Return the first so many poses."""
    return np.array([pose_of(values.atPose3(pose_key(k))) for k in range(count)])


def lines_of(values: gtsam.Values, ids: Sequence[int]) -> Float[np.ndarray, "n 2"]:
    """Return lines (alpha, r)."""
    return np.array([line_of(values.atOrientedPlane3(line_key(line))) for line in ids]).reshape(-1, 2)


@lru_cache(maxsize=256)
def _rows(lines: int) -> tuple[Int[np.ndarray, " s"], Float[np.ndarray, "s s"]]:
    """Return where (x, y, heading, alpha_1, r_1, ...) stand in the charts of a pose and of lines, and their signs."""
    charts = 6 + 3 * np.arange(lines)[:, None] + np.array(LINE_ROWS)
    sign = np.repeat([1.0, -1.0], [3, 2 * lines])
    return np.concatenate([POSE_ROWS, charts.ravel()]), np.outer(sign, sign)


def _params(config: GraphConfig) -> gtsam.ISAM2Params:
    params = gtsam.ISAM2Params()
    params.setOptimizationParams(gtsam.ISAM2GaussNewtonParams(config.wildfire))
    params.relinearizeSkip = 1 << 30  # Only when a push asks for it.
    angle, place = config.relinearise_angle_rad, config.relinearise_place_m
    thresholds = gtsam.ISAM2ThresholdMap()
    thresholds.insert(("x", np.array([angle, 1.0, 1.0, 1.0, place, place])))
    thresholds.insert(("l", np.array([angle, 1.0, place])))
    params.setRelinearizeThreshold(thresholds)
    params.setFactorization("QR" if config.careful else "CHOLESKY")
    params.findUnusedFactorSlots = True
    return params
