"""Limits that end a mission early, by what the robot itself can tell; they decide nothing but the end."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from .outcome import Outcome
from .step import Step


@dataclass(frozen=True)
class Limits:
    """How long a mission may take; None for as long as it likes."""

    steps: int | None = None
    path_m: float | None = None
    """By odometry."""
    time_s: float | None = None
    """On the robot's own clock: driving and scanning, not computing."""

    def reached(self, step: Step) -> tuple[Outcome, str] | None:
        """Return which limit this step has reached, and in words, or None."""
        if self.steps is not None and step.index + 1 >= self.steps:
            return Outcome.STEP_LIMIT, f"the limit of {self.steps} steps"
        if self.path_m is not None and step.path_length_m >= self.path_m:
            return Outcome.PATH_LIMIT, f"the limit of {self.path_m:g} m of path"
        if self.time_s is not None and step.time_s >= self.time_s:
            return Outcome.TIME_LIMIT, f"the limit of {self.time_s:g} s on the robot's clock"
        return None


def limited(steps: Iterable[Step], limits: Limits) -> Iterator[Step]:
    """Yield the steps of a mission up to the first that reaches a limit; that one is the last and says so."""
    for step in steps:
        end = limits.reached(step) if step.outcome is None else None
        if end is not None:
            yield replace(step, decision=replace(step.decision, outcome=end[0], words=end[1], command=None))
            return
        yield step
