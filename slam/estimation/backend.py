"""The interface of estimators: the `Backend` protocol, and the `Belief` that it returns.

The state of a line is (alpha, d) about a constant anchor c, with r = d + n(alpha)·c: its error is attached to the
wall, not to the world's origin. The anchor c = 0 is the paper's Hessian form.
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
    """The joint covariance of a belief was asked for after its back end had changed; ask for the present belief."""


class ContradictionError(RuntimeError):
    """Observations with which no estimate agrees: they are left out, and everything else is kept."""


POSE = 3
"""Size of a pose (x m, y m, heading rad), which stands before the lines in every joint state."""


def columns_of(rows: Int[np.ndarray, " m"]) -> Int[np.ndarray, " s"]:
    """Return where the pose and the lines of these rows stand in (x, y, heading, alpha_1, d_1, alpha_2, d_2, ...)."""
    columns = np.empty(POSE + 2 * len(rows), dtype=np.int64)
    columns[:POSE] = 0, 1, 2
    columns[POSE::2] = POSE + 2 * rows
    columns[POSE + 1 :: 2] = columns[POSE::2] + 1
    return columns


def rows_of(known: Int[np.ndarray, " n"], ids: Sequence[int] | Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
    """Return where these ids stand among the known ones (ascending); raises KeyError for an id that is not there."""
    wanted = np.asarray(ids, dtype=np.int64)
    if not len(known):
        if len(wanted):
            raise KeyError(f"expected ids of lines in the map, found {wanted.tolist()} in an empty map")
        return wanted
    rows = known.searchsorted(wanted)
    if (unknown := known.take(rows, mode="clip") != wanted).any():
        raise KeyError(f"expected ids of lines in the map, found {wanted[unknown].tolist()}")
    return rows


@dataclass(frozen=True)
class Joint:
    """Joint Gaussian of the pose and m lines: (x, y, heading, alpha_1, d_1, alpha_2, d_2, ...)."""

    mean: Float[np.ndarray, " s"]
    cov: Float[np.ndarray, "s s"]
    anchors: Float[np.ndarray, "m 2"]
    """Anchor of each line, world frame, m; s = 3 + 2 m."""

    def take(self, rows: Int[np.ndarray, " k"]) -> "Joint":
        """Return the Gaussian of the pose and the lines in these rows."""
        columns = columns_of(rows)
        return Joint(self.mean[columns], self.cov[columns[:, None], columns], self.anchors[rows])


@dataclass(frozen=True)
class Belief:
    """The estimate of the pose and n lines at one moment, in the world frame."""

    pose_world: Float[np.ndarray, "3"]
    pose_cov: Float[np.ndarray, "3 3"]
    ids: Int[np.ndarray, " n"]
    """Ids of the lines, ascending; an id is never used twice."""
    anchors: Float[np.ndarray, "n 2"]
    """Anchor c of each line, a constant point near its wall, m."""
    means: Float[np.ndarray, "n 2"]
    """(alpha rad, d m) of each line about its anchor."""
    query: Callable[[Int[np.ndarray, " m"]], Joint]
    """How the back end computes `joint`; raises `StaleBeliefError` once it has changed."""

    @cached_property
    def lines_world(self) -> Float[np.ndarray, "n 2"]:
        """The lines in Hessian form (alpha rad, r m), world frame; read-only."""
        lines = self.means.copy()
        lines[:, 1] += np.vecdot(normals(lines[:, 0]), self.anchors)
        lines.flags.writeable = False
        return lines

    def rows(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"]:
        """Return the rows of these ids; raises KeyError for an id that is not in the map."""
        return rows_of(self.ids, ids)

    def joint(self, ids: Sequence[int] | Int[np.ndarray, " m"]) -> Joint:
        """Return the joint Gaussian of the pose and these lines, with zeros for blocks that a back end drops."""
        return self.query(np.asarray(ids, dtype=np.int64))


@dataclass(frozen=True)
class Observations:
    """Lines observed in the robot's frame, and the lines of the map that they were matched to."""

    ids: Int[np.ndarray, " m"]
    """In any order; an id is repeated if a scan shows a wall in several pieces (one in two hundred does), each an
    observation with independent noise."""
    lines: Float[np.ndarray, "m 2"]
    """(alpha rad, r m); the normal alpha points into the wall."""
    cov: Float[np.ndarray, "m 2 2"]

    def __len__(self) -> int:
        return len(self.ids)


@runtime_checkable
class Backend(Protocol):
    """An estimator of the stochastic map.

    Its constructor takes a pose (x m, y m, heading rad) in the world frame and its covariance (3, 3), and, if its
    `BackendEntry` names a type of options, these as a third argument; the map is then empty. Each method that does not
    raise makes earlier beliefs stale. No method may keep or change the arrays that it is given.
    `chainslam.check_backend` tests a class against this contract.
    """

    @property
    def belief(self) -> Belief:
        """The present estimate."""
        ...

    def predict(self, odometry: Odometry) -> None:
        """Move the pose by the odometry."""
        ...

    def update(self, first: Observations, second: Observations) -> None:
        """Fuse one scan, given by the matches of the first pass and by those of the second.

        Both describe the same scan. A relocation-fusion back end corrects the pose by `first` and the map by `second`;
        a joint back end uses `second` alone, so that each observation counts once. A back end that keeps all
        observations may raise ContradictionError when its belief is asked for next.
        """
        ...

    def grow(
        self, lines: Float[np.ndarray, "m 2"], cov: Float[np.ndarray, "m 2 2"], centres: Float[np.ndarray, "m 2"]
    ) -> Int[np.ndarray, " m"]:
        """Initialise lines observed in the robot's frame, each with the middle of its segment; return their ids."""
        ...

    def merge(self, keep: int, drop: int) -> None:
        """Merge two lines that are one wall, and keep the id `keep`.

        Raises KeyError for an id that is not in the map, and ValueError if both are the same.
        """
        ...

    def remove(self, ids: Sequence[int]) -> None:
        """Remove lines; raises KeyError for an id that is not in the map."""
        ...


@runtime_checkable
class Smoother(Backend, Protocol):
    """A back end that can smooth the whole path when a run has ended."""

    def finish(self) -> Float[np.ndarray, "n 3"]:
        """Return the smoothed poses at the start and after each prediction; later beliefs are of that solution."""
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
