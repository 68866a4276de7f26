"""One strategy after another: exchanged at given steps while the robot drives."""

from collections.abc import Sequence

from ..following.surroundings import Surroundings
from .strategy import Choice, Situation, Strategy, Watchful


class Schedule:
    """Lets each of several strategies choose from its step on; the goal of the one before is finished first."""

    def __init__(self, parts: Sequence[tuple[int, Strategy]]) -> None:
        """Take (first step, strategy) in order of the steps, the first from step 0."""
        self._parts = parts

    def choose(self, situation: Situation) -> Choice | None:
        """Return the choice of the strategy whose turn it is."""
        return [strategy for first, strategy in self._parts if first <= situation.step][-1].choose(situation)

    def watch(self, around: Surroundings) -> None:
        """Let each of them that looks at every step look at this one."""
        for _, strategy in self._parts:
            if isinstance(strategy, Watchful):
                strategy.watch(around)
