"""Where the robot goes next and why, and what it gave up."""

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


@dataclass(frozen=True)
class GivenUp:
    """What exploration gave up so far, as its ledger holds it at one step."""

    ends: tuple[SetAside, ...] = ()
    """The ends that are set aside, whether the map has them open still or not."""
    places: tuple[LeftPlace, ...] = ()
    near_m: float = 0.0
    """Places this near to each other are one."""

    @property
    def keys(self) -> frozenset[tuple[int, int]]:
        """(wall id, side) of the ends."""
        return frozenset((end.wall, end.side) for end in self.ends)

    def troubles_at(self, position_world: Float[np.ndarray, "2"]) -> list[str]:
        """Return what was in the way at each visit of a place, m."""
        near = (p for p in self.places if np.hypot(*(p.position_world - position_world)) < self.near_m)
        return [place.trouble for place in near]
