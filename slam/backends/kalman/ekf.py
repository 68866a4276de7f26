"""An extended Kalman filter over (x, y, heading, alpha_1, d_1, ...), in methods that can be replaced one by one.

A filter is this class with a map that keeps all covariances or only blocks, and with what it does differently:
where it takes its Jacobians, which observations move what, what it does to P afterwards.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Generic, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import POSE, Belief, Joint, Observations, StaleBeliefError
from ...estimation.models import Initialisation, Innovations, Linear, Motion, initialise, innovations, move, stack
from ...geometry.numerics import LEAST_SIGMA
from ...robot import Odometry
from ..frame.frame import Frame
from .config import EkfConfig
from .linear import equality

DEFAULTS = EkfConfig()
ONE_WALL = LEAST_SIGMA**2 * np.eye(2)
"""Two lines known to be one leave S singular: a thousandth of a millimetre keeps it invertible."""


@runtime_checkable
class GaussianMap(Protocol):
    """Where a filter keeps its mean and covariance."""

    ids: Int[np.ndarray, " n"]
    anchors: Float[np.ndarray, "n 2"]

    @property
    def pose_world(self) -> Float[np.ndarray, "3"]: ...  # noqa: D102
    @property
    def pose_cov(self) -> Float[np.ndarray, "3 3"]: ...  # noqa: D102
    @property
    def means(self) -> Float[np.ndarray, "n 2"]: ...  # noqa: D102

    def joint(self, rows: Int[np.ndarray, " m"]) -> Joint:
        """Return the Gaussian of the pose and some lines."""
        ...

    def move(self, motion: Motion, Q: Float[np.ndarray, "3 3"]) -> None:
        """Take the pose along a motion that adds noise of covariance Q."""
        ...

    def append(self, new: Initialisation, noise: Float[np.ndarray, "m 2 2"]) -> Int[np.ndarray, " m"]:
        """Add lines with what noise adds to the pose's part in their covariance; return their ids."""
        ...

    def drop(self, rows: Int[np.ndarray, " m"]) -> None:
        """Forget lines."""
        ...

    def condition(self, model: Linear) -> None:
        """Take in a measurement."""
        ...


M = TypeVar("M", bound=GaussianMap)


class Ekf(Generic[M]):
    """An EKF on a map; as it stands, every observation counts once, in one joint update a scan.

    A map whose first wall comes into sight after a drive begins in a frame of its own (`Frame`); the filter then
    works in that frame, and only `belief` is in the world's.

    A filter of one's own inherits from one that is there and replaces these methods, each for itself:

    - `motion`: the motion model, and the noise that it adds to the pose's error;
    - `first_sight`: new lines, and the noise of the measurement in them;
    - `compare`: innovations, their noise R and their Jacobians;
    - `linearise`: where Jacobians of a scan are taken. `Linear.place` tells which line each observation is of;
    - `observe`: what a scan does to the map;
    - `unite`: what it does to the map that two lines were found to be one;
    - `forget`: lines are dropped, merged or removed.

    All of them work on `map`, by rows rather than ids, after the belief has become stale.
    """

    map: M
    """Mean and covariance of the pose and the lines, in the filter's own frame."""
    config: EkfConfig

    new_map: Callable[[np.ndarray, np.ndarray], M]
    """Makes the map that this filter works on, from a pose and its covariance."""
    _odometry_cov: Float[np.ndarray, "3 3"]
    """Covariance of the odometry since the last update."""

    def __init__(
        self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"], config: EkfConfig = DEFAULTS
    ) -> None:
        """Start at a pose with its covariance and an empty map."""
        self.map = self.new_map(pose_world, pose_cov)
        self.config = config
        self._frame: Frame | None = None
        self._has_driven = False
        self._version = 0
        self._belief: Belief | None = None
        self._begin()

    @property
    def belief(self) -> Belief:
        """The estimate now."""
        if self._belief is None:
            self._belief = self._new_belief()
        return self._belief

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by the odometry."""
        self._move_on()
        self._has_driven = True
        motion, noise = self.motion(odometry)
        self.map.move(motion, noise)
        self._odometry_cov = motion.F @ self._odometry_cov @ motion.F.T + noise

    def update(self, first: Observations, second: Observations) -> None:
        """Fuse one scan's matches at once (`second`; a joint filter has no use for `first`)."""
        if len(second.ids):
            rows = self.belief.rows(second.ids)
            self._move_on()
            self.observe(rows, second)
            self._odometry_cov = np.zeros((POSE, POSE))

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Add lines seen in the robot frame and return their ids."""
        if self.config.at_wall and self._has_driven and not len(self.map.ids):
            self._begin_frame()
        self._move_on()
        return self.map.append(*self.first_sight(lines, cov, centres))

    def merge(self, keep: int, drop: int) -> None:
        """Condition the map on `keep` and `drop` being one line, then forget `drop`."""
        rows = self.belief.rows([keep, drop])
        if keep == drop:
            raise ValueError(f"expected two lines to merge, found line {keep} twice")
        self._move_on()
        self.unite(rows)
        self.forget(rows[1:])

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map."""
        rows = self.belief.rows(ids)
        self._move_on()
        self.forget(rows)

    def motion(self, odometry: Odometry) -> tuple[Motion, Float[np.ndarray, "3 3"]]:
        """Return the motion, and the covariance of the noise that it adds to the pose's error."""
        motion = move(self.map.pose_world, odometry.motion)
        return motion, motion.noise(odometry.cov)

    def first_sight(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> tuple[Initialisation, Float[np.ndarray, "m 2 2"]]:
        """Return new lines, and the covariance that each has beside what it has of the pose."""
        new = initialise(self.map.pose_world, lines, centres, self.config.at_wall)
        return new, new.noise(cov)

    def compare(
        self,
        rows: Int[np.ndarray, " m"],
        seen: Observations,
        pose_world: Float[np.ndarray, "3"],
        means: Float[np.ndarray, "m 2"],
    ) -> Innovations:
        """Compare observations with what a pose and the means of their rows predict; R is their noise."""
        return innovations(pose_world, self.map.anchors[rows], means, seen.lines, seen.cov)

    def linearise(self, rows: Int[np.ndarray, " m"], seen: Observations) -> Linear:
        """Linearise a scan, by default at the pose that corrects the odometry, not where it left the estimate.

        An error of 1.5 degrees bends a line's prediction 2.6 m away by 0.9 mm, as much as the line is known to. The
        correction is what the scan says of the odometry if all else were known: were pose and lines to go where the
        whole update takes them, their common shift and turn, which no scan can tell, would move the Jacobian too, and
        be taken for measured.
        """
        pose, means = self.map.pose_world, self.map.means[rows]
        here = stack(rows, self.compare(rows, seen, pose, means))
        if not self.config.relinearise:
            return here
        H = here.H[:, :POSE]
        step = self._odometry_cov @ H.T @ np.linalg.solve(H @ self._odometry_cov @ H.T + here.R, here.e)
        return stack(rows, self.compare(rows, seen, pose + step, means)).before(step)

    def observe(self, rows: Int[np.ndarray, " m"], seen: Observations) -> None:
        """Take in the observations of one scan, each of the line of its row."""
        self.map.condition(self.linearise(rows, seen))

    def unite(self, rows: Int[np.ndarray, "2"]) -> None:
        """Take in that the lines of two rows are one, before the second is forgotten."""
        self._equate(rows)

    def forget(self, rows: Int[np.ndarray, " m"]) -> None:
        """Forget the lines of these rows, merged or removed."""
        self.map.drop(rows)

    def _begin(self) -> None:
        """Begin what the filter remembers beside its map, which has no lines."""
        self._odometry_cov = np.zeros((POSE, POSE))

    def _begin_frame(self) -> None:
        """Let the map begin here: what was lost before the first wall came into sight is the frame's error."""
        self._frame = Frame(self.belief.pose_world, self.belief.pose_cov)
        nothing = np.zeros((POSE, POSE))
        self.map.move(Motion(np.zeros(POSE), nothing, nothing), nothing)
        self._begin()

    def _equate(self, rows: Int[np.ndarray, "2"], alpha: float | None = None) -> None:
        """Condition the map on two lines being one, with the Jacobian at the direction `alpha` if given."""
        H, e = equality(self.map.means[rows], self.map.anchors[rows], alpha)
        self.map.condition(Linear(rows, H, e, ONE_WALL))

    def _move_on(self) -> None:
        self._version += 1
        self._belief = None

    def _new_belief(self) -> Belief:
        m, query = self.map, partial(self._query, self._version)
        if self._frame is None:
            return Belief(m.pose_world, m.pose_cov, m.ids, m.anchors, m.means, query)
        pose = self._frame.joint_world(Joint(m.pose_world, m.pose_cov, m.anchors[:0]))
        anchors, means = self._frame.anchors_world(m.anchors), self._frame.means_world(m.means)
        return Belief(pose.mean, pose.cov, m.ids, anchors, means, query)

    def _query(self, version: int, wanted: Int[np.ndarray, " m"]) -> Joint:
        if version != self._version:
            raise StaleBeliefError("expected a belief of the present step, found one whose back end has moved on")
        joint = self.map.joint(self.belief.rows(wanted))
        return joint if self._frame is None else self._frame.joint_world(joint)
