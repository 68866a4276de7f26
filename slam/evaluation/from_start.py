"""The pose relative to the start: what the estimate would be had the start been known, on the very same observations.

Nothing can observe the error of the start, and with it in the covariance a pose's NEES says little of all that came
after. So the pose is scored once more as though the run had begun with `--p0 zero`:

- A back end that carries the start's error along untouched (`BackendEntry.carries_start`) has P = A P0 A' + P_rel in
  the invariant error. P0 is taken out of it, and that of `--p0 zero` put in; the estimate moves as a whole.
- Any other is told everything twice: beside it a second one begins with `--p0 zero`, hears the same motions, matches,
  new walls and mergers, and decides nothing. It says what the filter claims, where P - A P0 A' may be no covariance.

Both are the same to first order for an estimate that gains nothing on where the world lies.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from ..association.ranges.calibrated_backend import CalibratedBackend
from ..estimation.backend import Backend, Belief
from ..estimation.mounting import belief_of_body
from ..geometry.poses import J, compose, inverse, rotation
from ..robot import ScannerSpec
from .consistency import pose_covariances

VERBS = ("predict", "update", "grow", "merge", "remove")
Pose = Float[np.ndarray, "3"]
Cov = Float[np.ndarray, "3 3"]
UNKNOWN = np.full(3, np.nan), np.full((3, 3), np.nan)


@runtime_checkable
class FromStart(Protocol):
    """Tells, step by step, the pose as it would be had the start been known."""

    def __call__(self, belief: Belief) -> tuple[Pose, Cov]:
        """Return pose and covariance, for the belief about the body at a step; NaN where there is none."""
        ...


@dataclass(frozen=True)
class Start:
    """Where an estimate begins, and where the body truly does; world frame, m m rad."""

    estimate_world: Pose
    cov: Cov
    true_world: Pose

    def known(self, sigmas: Pose) -> "Start":
        """Return a start of smaller standard deviations m, m, rad; its error is the same draw in units of them."""
        draw = (self.estimate_world - self.true_world) / np.sqrt(np.diag(self.cov))
        return Start(self.true_world + sigmas * draw, np.diag(sigmas**2), self.true_world)


def from_start(
    backend: Backend,
    carries_start: bool,
    start: Start,
    known: Start,
    make: Callable[[Pose, Cov], Backend],
    scanner: ScannerSpec,
) -> FromStart:
    """Return what tells the pose relative to the start of a back end that has not moved yet.

    `known` is the start that takes the place of its own; `make` makes another of its kind for a body at a pose.
    """
    if carries_start:
        return _Without(start, known)
    second = make(known.estimate_world, known.cov)
    if isinstance(backend, CalibratedBackend) and isinstance(second, CalibratedBackend):
        second.taken = backend.taken
    return _Beside(backend, second, scanner)


def as_it_is(belief: Belief) -> tuple[Pose, Cov]:
    """Return the pose as it is believed: of a start that is known, or where there is no truth to score by."""
    return belief.pose_world, belief.pose_cov


@dataclass(frozen=True)
class _Without:
    """Takes the error of the start out of an estimate that carries it along."""

    start: Start
    known: Start

    def __call__(self, belief: Belief) -> tuple[Pose, Cov]:
        """Return the pose as seen from the known start."""
        begin, known = self.start.estimate_world, self.known.estimate_world
        pose = compose(known, compose(inverse(begin), belief.pose_world))
        # About the start the invariant error of a pose is the start's own and what was lost since: they only add up.
        around = np.append(belief.pose_world[:2] - begin[:2], 0.0)
        own = pose_covariances(around[None], belief.pose_cov[None])[0] - self.start.cov
        turned, lever = np.eye(3), np.eye(3)
        turned[:2, :2] = rotation(float(known[2] - begin[2]))
        lever[:2, 2] = J @ (pose[:2] - known[:2])
        return pose, lever @ (turned @ own @ turned.T + self.known.cov) @ lever.T


@dataclass
class _Beside:
    """A second back end that hears all that the first is told."""

    first: Backend
    second: Backend
    scanner: ScannerSpec
    _heard: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)
    _depth: int = 0
    _is_lost: bool = False

    def __post_init__(self) -> None:
        for verb in VERBS:
            setattr(self.first, verb, self._overheard(verb, getattr(self.first, verb)))

    def __call__(self, belief: Belief) -> tuple[Pose, Cov]:
        """Tell the second back end what the first was told since, and return its pose."""
        heard, self._heard = self._heard, []
        if self._is_lost:
            return UNKNOWN
        try:
            for verb, told in heard:
                getattr(self.second, verb)(*told)
            belief = self.second.belief
            if isinstance(self.second, CalibratedBackend):
                belief = self.second.unsure(belief)
            own = belief_of_body(belief, self.scanner)
        except Exception:  # whatever a failing back end raises must not end the run that it stands beside
            self._is_lost = True
            return UNKNOWN
        return own.pose_world, own.pose_cov

    def _overheard(self, verb: str, told: Callable[..., Any]) -> Callable[..., Any]:
        def hear(*args: Any) -> Any:
            # A verb may call another of its own, which the second back end's does, too.
            if not self._depth:
                self._heard.append((verb, args))
            self._depth += 1
            try:
                return told(*args)
            finally:
                self._depth -= 1

        return hear
