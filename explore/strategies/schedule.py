"""One strategy after another: exchanged at given steps while the robot drives."""

from collections.abc import Sequence

from .strategy import Choice, Situation, Strategy


class Schedule:
    """Lets each of several strategies choose from its step on; the goal of the one before is finished first."""

    def __init__(self, parts: Sequence[tuple[int, Strategy]]) -> None:
        """Take (first step, strategy) in order of the steps, the first from step 0."""
        self._parts = parts

    def choose(self, situation: Situation) -> Choice | None:
        """Return the choice of the strategy whose turn it is."""
        return [strategy for first, strategy in self._parts if first <= situation.step][-1].choose(situation)
