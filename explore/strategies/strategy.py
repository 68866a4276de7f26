"""The protocol that every exploration strategy keeps: from what is known to a goal and the reason for it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from slam.chains import Chain, OpenEnd
from slam.stochastic_map import StochasticMap


@dataclass(frozen=True)
class Situation:
    """What a strategy may read: the map and its covariance, never the truth."""

    map: StochasticMap
    chains: tuple[Chain, ...]
    candidates: tuple[OpenEnd, ...]
    """The open ends that exploration has not set aside; at least one."""
    start_world: Float[np.ndarray, "2"]
    """Where the robot began, m."""
    current_wall: int | None
    """Id of the wall that the robot followed last."""
    nearest: Callable[[Sequence[OpenEnd]], tuple[int, float] | None]
    """Which of some open ends is the shortest drive away, and how far, m; None if the way to none is known."""


@dataclass(frozen=True)
class Choice:
    """One of the candidates and why."""

    end: OpenEnd
    reason: str


@runtime_checkable
class Strategy(Protocol):
    """Chooses the open end to explore next."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the choice, or None where no candidate can be driven to now."""
        ...
