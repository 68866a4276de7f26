"""Where to explore next: one file for each strategy, and one line in the registry."""

from collections.abc import Callable
from dataclasses import dataclass

from .adaptive import Adaptive
from .frontier import Frontier
from .nearest_robot import NearestRobot
from .nearest_start import NearestStart
from .same_chain import SameChain
from .schedule import Schedule
from .strategy import Choice, Place, Situation, Strategy, Watchful
from .uncertainty import Uncertainty


@dataclass(frozen=True)
class StrategyEntry:
    """An entry of the registry of strategies."""

    make: Callable[[], Strategy]
    description: str


STRATEGIES: dict[str, StrategyEntry] = {
    "nearest-robot": StrategyEntry(NearestRobot, "the open end that is the shortest drive away (paper, figure 5)"),
    "same-chain": StrategyEntry(SameChain, "close the actual chain before beginning another (paper, section 3.3)"),
    "nearest-start": StrategyEntry(NearestStart, "the open end closest to the start (paper, figure 6)"),
    "frontier": StrategyEntry(Frontier, "borders of seen floor, then the open ends left (the classical baseline)"),
    "uncertainty": StrategyEntry(Uncertainty, "the open end with the most to learn a metre, by the joint covariance"),
    "adaptive": StrategyEntry(
        Adaptive, "nearest-robot, with returns to well-known walls where the filter must be inconsistent"
    ),
}
BUILT_IN = frozenset(STRATEGIES)
"""What comes along; other names are a user's own, of which the processes of a campaign are told."""


def make_strategy(words: str) -> Strategy:
    """Return the strategy of a name, or of a schedule such as `nearest-robot,same-chain@200`: the second from step 200.

    Raises ValueError, with one line that says what was expected, for anything else.
    """
    parts: list[tuple[int, Strategy]] = []
    for index, word in enumerate(words.split(",")):
        name, at, step = word.partition("@")
        if name not in STRATEGIES:
            raise ValueError(f"expected a strategy from {', '.join(STRATEGIES)}, found {name!r}: choose one of these")
        first = 0 if index == 0 and not at else int(step) if step.isascii() and step.isdigit() else -1
        if first < 0 or (index == 0 and first > 0) or (parts and first <= parts[-1][0]):
            raise ValueError(
                f"expected strategies with the steps of the changes, in order, found {words!r}: write A,B@200,C@500"
            )
        parts.append((first, STRATEGIES[name].make()))
    return parts[0][1] if len(parts) == 1 else Schedule(parts)


__all__ = [
    "BUILT_IN",
    "STRATEGIES",
    "Choice",
    "Place",
    "Situation",
    "Strategy",
    "StrategyEntry",
    "Watchful",
    "make_strategy",
]
