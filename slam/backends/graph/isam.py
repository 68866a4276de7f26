"""iSAM2 over poses and lines: what is entered is collected and handed over in one push, then questions are answered."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import gtsam
import numpy as np
from jaxtyping import Float, Int

from .config import GraphConfig
from .factors import LINE_ROWS, POSE_ROWS, line_key, line_of, plane, pose3, pose_key, pose_of

_POSE_BLOCK = np.ix_(POSE_ROWS, POSE_ROWS)


class Isam:
    """Factors and values on their way into iSAM2, and what it knows of poses (by index) and lines (by id)."""

    def __init__(self, config: GraphConfig) -> None:
        self._config = config
        self._isam = gtsam.ISAM2(_params(config))
        self.factors, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        """Collected and not yet pushed."""
        self._removals: list[int] = []
        self._entering: list[int] = []
        self._slots: dict[int, int] = {}
        self._near: list[int] = []

    # -- entering ---------------------------------------------------------------------------------------------------

    def enter_pose(self, index: int, pose: Float[np.ndarray, "3"]) -> None:
        """Enter a pose, to be linearised there."""
        self.values.insert(pose_key(index), pose3(pose))

    def move_pose(self, index: int, pose: Float[np.ndarray, "3"]) -> None:
        """Linearise a pose that is not yet pushed elsewhere."""
        self.values.update(pose_key(index), pose3(pose))

    def is_new(self, index: int) -> bool:
        """Whether a pose is not yet pushed."""
        return bool(self.values.exists(pose_key(index)))

    def enter_line(self, line: int, alpha: float, r: float) -> None:
        """Enter a line, to be linearised there."""
        self.values.insert(line_key(line), gtsam.OrientedPlane3(plane(alpha, r)))

    def enter(self, factor: gtsam.NonlinearFactor, number: int = -1) -> None:
        """Enter a factor; one with a number (of its observation) may leave again."""
        self.factors.push_back(factor)
        self._entering.append(number)

    def leave(self, number: int) -> None:
        """Take the factor of this number out; it must have been pushed."""
        self._removals.append(self._slots.pop(number))

    def holds(self, number: int) -> bool:
        """Whether the factor of this number was pushed."""
        return number in self._slots

    def forget(self, line: int) -> None:
        """No longer prepare for questions about a line."""
        self._near = [key for key in self._near if key != line_key(line)]

    @property
    def is_waiting(self) -> bool:
        """Whether there is something to push."""
        return bool(self._entering or self._removals)

    def push(self, last: int, relinearise: bool = False) -> int:
        """Hand over what was collected; `last` is the pose now. Return how many variables were linearised anew.

        The pose now, what this step sees and the lines that were asked for together with the pose are eliminated
        last: the next such question is then answered from the top of the tree, four to seven times as fast.
        """
        top, again = gtsam.KeyGroupMap(), gtsam.KeyList()
        top.insert2(pose_key(last), 1)
        for key in self.factors.keyVector():
            top.insert2(key, 1)
        for key in self._near:
            top.insert2(key, 1)
            again.push_back(key)
        result = self._isam.update(self.factors, self.values, self._removals, top, None, again, relinearise)
        if self._entering:
            for number, slot in zip(self._entering, result.getNewFactorsIndices(), strict=True):
                if number >= 0:
                    self._slots[number] = slot
            self.factors, self.values, self._entering = gtsam.NonlinearFactorGraph(), gtsam.Values(), []
        self._removals = []
        return int(result.getVariablesRelinearized())

    # -- asking -----------------------------------------------------------------------------------------------------

    def linearisation(self) -> "Estimates":
        """Return the points of linearisation, of what is collected and not yet pushed too."""
        values = gtsam.Values(self._isam.getLinearizationPoint())
        values.insert_or_assign(self.values)
        return Estimates(values)

    def pose(self, index: int) -> Float[np.ndarray, "3"]:
        """Return the present estimate of one pose."""
        return pose_of(self._isam.calculateEstimatePose3(pose_key(index)))

    def all(self) -> "Estimates":
        """Return the present estimates of everything."""
        return Estimates(self._isam.calculateBestEstimate())

    def moved(self, keys: Sequence[int]) -> Float[np.ndarray, " s"]:
        """Return by how much lines (by their keys) have moved from where they are linearised, in their charts."""
        return np.asarray(self._isam.getDelta().vector(keys))

    def lines(self, keys: Sequence[int]) -> Float[np.ndarray, "n 2"]:
        """Return the points (alpha, r) where lines (by their keys) are linearised."""
        values = self._isam.getLinearizationPoint()
        return np.array([line_of(values.atOrientedPlane3(key)) for key in keys]).reshape(-1, 2)

    def pose_cov(self, index: int) -> Float[np.ndarray, "3 3"]:
        """Return the covariance of a pose, body frame."""
        return np.asarray(self._isam.marginalCovariance(pose_key(index))[_POSE_BLOCK])

    def pair_cov(self, first: int, second: int) -> Float[np.ndarray, "6 6"]:
        """Return the covariance of two poses, each in its body frame."""
        found = self._isam.jointMarginalCovariance([pose_key(first), pose_key(second)]).fullMatrix()
        rows = np.concatenate([POSE_ROWS, 6 + np.array(POSE_ROWS)])
        return np.asarray(found[np.ix_(rows, rows)])

    def joint_cov(self, index: int, keys: Sequence[int]) -> Float[np.ndarray, "s s"]:
        """Return the covariance of a pose (body frame) and of lines (alpha, r) by their keys, by one query."""
        if len(keys) <= self._config.near:
            self._near = sorted(keys)
        found = self._isam.jointMarginalCovariance([pose_key(index), *keys]).fullMatrix()
        rows = _joint_rows(len(keys))
        cov = found[rows[:, None], rows]
        cov[:3, 3:] *= -1.0
        cov[3:, :3] *= -1.0
        return cov


@dataclass(frozen=True)
class Estimates:
    """Values of all poses and lines at one moment."""

    values: gtsam.Values

    def poses(self, count: int) -> Float[np.ndarray, "p 3"]:
        """Return the first so many poses."""
        return np.array([pose_of(self.values.atPose3(pose_key(k))) for k in range(count)])

    def lines(self, ids: Sequence[int]) -> Float[np.ndarray, "n 2"]:
        """Return lines (alpha, r)."""
        return np.array([line_of(self.values.atOrientedPlane3(line_key(line))) for line in ids]).reshape(-1, 2)


@lru_cache(maxsize=256)
def _joint_rows(lines: int) -> Int[np.ndarray, " s"]:
    """Return where (x, y, heading, alpha_1, r_1, ...) stand in the charts of a pose and so many lines."""
    charts = 6 + 3 * np.arange(lines)[:, None] + np.array(LINE_ROWS)
    return np.concatenate([POSE_ROWS, charts.ravel()])


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
