"""Which open end next: one file for each strategy, and one line in the registry."""

from collections.abc import Callable
from dataclasses import dataclass

from .nearest_robot import NearestRobot
from .strategy import Choice, Situation, Strategy


@dataclass(frozen=True)
class StrategyEntry:
    """How to make a strategy, and what it is."""

    make: Callable[[], Strategy]
    description: str


STRATEGIES: dict[str, StrategyEntry] = {
    "nearest-robot": StrategyEntry(NearestRobot, "the open end that is the shortest drive away (paper, figure 5)"),
}

__all__ = ["STRATEGIES", "Choice", "Situation", "Strategy", "StrategyEntry"]
