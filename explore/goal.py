"""What a strategy decides: where to go next and why."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Goal:
    """An open end to visit, or a place to look at."""

    kind: str
    """`open-end`, `unseen` (floor not yet seen), `unexplained` (something that is no wall of the map),
    `known-walls` (walls known well) or `start` (the way home)."""
    wall: int | None
    """Id of the wall whose open end it is; None for a place."""
    side: int | None
    """`TAIL` or `HEAD` of that wall."""
    position_world: Float[np.ndarray, "2"]
    """The open end, or the place, m."""
    reason: str
    """Why the strategy chose it, in words."""


@dataclass(frozen=True)
class SetAside:
    """An open end that exploration gave up, and why; it is tried again when the map there has changed."""

    wall: int
    side: int
    position_world: Float[np.ndarray, "2"]
    reason: str


@dataclass(frozen=True)
class LeftPlace:
    """A border of unseen floor that was to be visited, and what was in the way; nothing, if the robot got there."""

    position_world: Float[np.ndarray, "2"]
    trouble: str
