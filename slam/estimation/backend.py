"""What an estimator offers: the `Backend` protocol, and the `Belief` that it hands out.

A line's state is (alpha, d) about a constant anchor c, with r = d + n(alpha)·c: its error is attached to the
wall where it was seen, not to the world's origin. The anchor c = 0 is the paper's Hessian form.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int

from ..geometry.lines import normals
from ..robot import Odometry


class StaleBeliefError(RuntimeError):
    """A belief was asked for its joint covariance after its back end had moved on: ask for the present belief."""


class ContradictionError(RuntimeError):
    """Observations with which no estimate agrees: they are left out again, and the rest holds."""


POSE = 3
"""Size of a pose (x m, y m, heading rad), which stands before the lines in every joint state."""


def columns_of(rows: Int[np.ndarray, " m"]) -> Int[np.ndarray, " s"]:
    """Return where the pose and the lines of these rows stand in (x, y, heading, alpha_1, d_1, alpha_2, d_2, ...)."""
    columns = np.empty(POSE + 2 * len(rows), dtype=np.int64)
    columns[:POSE] = 0, 1, 2
    columns[POSE::2] = POSE + 2 * rows
    columns[POSE + 1 :: 2] = columns[POSE::2] + 1
    return columns


@dataclass(frozen=True)
class Joint:
    """A Gaussian of the pose and some lines together: (x, y, heading, alpha_1, d_1, alpha_2, d_2, ...)."""

    mean: Float[np.ndarray, " s"]
    cov: Float[np.ndarray, "s s"]
    anchors: Float[np.ndarray, "m 2"]
    """Anchor of each of the lines, world frame, m; s = 3 + 2 m."""

    def take(self, rows: Int[np.ndarray, " k"]) -> "Joint":
        """Return the Gaussian of the pose and some of the lines."""
        columns = columns_of(rows)
        return Joint(self.mean[columns], self.cov[columns[:, None], columns], self.anchors[rows])


@dataclass(frozen=True)
class Belief:
    """The estimate at one moment, in the world frame."""

    pose_world: Float[np.ndarray, "3"]
    pose_cov: Float[np.ndarray, "3 3"]
    ids: Int[np.ndarray, " n"]
    """Ids of the lines in ascending order; an id is never used again."""
    anchors: Float[np.ndarray, "n 2"]
    """A constant point c near each wall, m."""
    means: Float[np.ndarray, "n 2"]
    """(alpha rad, d m) of each line about its anchor."""
    query: Callable[[Int[np.ndarray, " m"]], Joint]
    """How the back end answers `joint`; raises `StaleBeliefError` once it has moved on."""

    @cached_property
    def lines_world(self) -> Float[np.ndarray, "n 2"]:
        """The lines in the paper's Hessian form (alpha, r), world frame. Read-only."""
        r = self.means[:, 1] + np.vecdot(normals(self.means[:, 0]), self.anchors)
        lines = np.stack([self.means[:, 0], r], axis=-1)
        lines.flags.writeable = False
        return lines

    def rows(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return where the ids stand in `ids`; raises KeyError for an id that is not in the map."""
        wanted = np.asarray(ids, dtype=np.int64)
        if not len(self.ids):
            if len(wanted):
                raise KeyError(f"expected ids of lines in the map, found {wanted.tolist()} in an empty map")
            return wanted
        rows = np.minimum(np.searchsorted(self.ids, wanted), len(self.ids) - 1)
        if np.any(self.ids[rows] != wanted):
            raise KeyError(f"expected ids of lines in the map, found {wanted[self.ids[rows] != wanted].tolist()}")
        return rows

    def joint(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Joint:
        """Return mean and covariance of the pose and the chosen lines; zeros where a back end keeps none."""
        return self.query(np.asarray(ids, dtype=np.int64))


@dataclass(frozen=True)
class Observations:
    """Lines seen in the robot frame and the map lines that they were matched to."""

    ids: Int[np.ndarray, " m"]
    """In any order, and one id several times where a scan shows a wall in several pieces: one scan in two hundred does.
    Each piece is an observation of its own, with its own noise."""
    lines: Float[np.ndarray, "m 2"]
    """(alpha rad, r m), alpha pointing into the wall."""
    cov: Float[np.ndarray, "m 2 2"]

    def __len__(self) -> int:
        return len(self.ids)


@runtime_checkable
class Backend(Protocol):
    """An estimator of the stochastic map: a few verbs, its state hidden, its belief shown.

    It is made from a pose (x m, y m, heading rad), world frame, and its covariance (3, 3), with an empty map; a third
    argument is its options, if its `BackendEntry` names their type. Every verb but one that raises makes beliefs handed
    out before stale. No verb may keep or change the arrays that it is given. `chainslam.check_backend` holds a class
    against all this.
    """

    @property
    def belief(self) -> Belief:
        """The estimate now."""
        ...

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by the odometry."""
        ...

    def update(self, first: Observations, second: Observations) -> None:
        """Take in one scan: the matches made before the robot was relocated, and those made after.

        Both describe the same scan. A relocation-fusion back end moves the robot by `first` and the map by
        `second`; a joint back end uses `second` alone, so that each observation counts once. One that keeps all
        observations may raise ContradictionError when its belief is asked for next: no estimate agrees with these.
        """
        ...

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Initialise lines seen in the robot frame (with the middle of each seen piece) and return their new ids."""
        ...

    def merge(self, keep: int, drop: int) -> None:
        """Make two lines one, because they were found to be one wall; `keep` survives.

        Raises KeyError where an id is not in the map, and ValueError for one line twice.
        """
        ...

    def remove(self, ids: Sequence[int]) -> None:
        """Forget lines; raises KeyError where an id is not in the map."""
        ...


@runtime_checkable
class Smoother(Backend, Protocol):
    """A back end that can solve everything once more when a run has ended."""

    def finish(self) -> Float[np.ndarray, "n 3"]:
        """Return the poses, world frame, at the start and after every prediction; beliefs then are of that solution."""
        ...


@runtime_checkable
class PathKeeper(Backend, Protocol):
    """A back end that keeps every pose, so that it knows how any two of them err together."""

    def trajectory(self) -> Float[np.ndarray, "n 3"]:
        """Return the present estimates, world frame, of the pose at the start and after every prediction."""
        ...

    def pair_covs(self, first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 6 6"]:
        """Return the joint covariance of pairs of these poses, by their rows, each pose's error in its own frame.

        NaN for a pose of before the first wall came into sight: what is known of it is not in the map.
        """
        ...
