"""Where to explore next: one file for each strategy, and one line in the registry."""

from collections.abc import Callable
from dataclasses import dataclass

from .frontier import Frontier
from .nearest_robot import NearestRobot
from .nearest_start import NearestStart
from .same_chain import SameChain
from .strategy import Choice, Place, Situation, Strategy


@dataclass(frozen=True)
class StrategyEntry:
    """How to make a strategy, and what it is."""

    make: Callable[[], Strategy]
    description: str


STRATEGIES: dict[str, StrategyEntry] = {
    "nearest-robot": StrategyEntry(NearestRobot, "the open end that is the shortest drive away (paper, figure 5)"),
    "same-chain": StrategyEntry(SameChain, "close the actual chain before beginning another (paper, section 3.3)"),
    "nearest-start": StrategyEntry(NearestStart, "the open end closest to the start (paper, figure 6)"),
    "frontier": StrategyEntry(Frontier, "borders of seen floor, then the open ends left (the classical baseline)"),
}

__all__ = ["STRATEGIES", "Choice", "Place", "Situation", "Strategy", "StrategyEntry"]
