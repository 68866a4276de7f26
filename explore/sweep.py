"""What is left when no open end is: floor never seen, things that are no wall; and what came of each visit there."""

from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray

from .goal import LeftPlace
from .spots import Spots
from .strategies import Choice, Place, Situation
from .strategies.nearest import nearest_unexplained, nearest_unseen


@dataclass(frozen=True)
class SweepConfig:
    """How often a place is visited."""

    visits: int = 2
    """A border of unseen floor, or a thing that is no wall, that is still one after so many visits is left."""
    near_m: float = 0.3
    """Borders whose middles lie this near to each other are one."""


class Sweep:
    """Chooses the next place, and remembers what came of the visits."""

    def __init__(self, config: SweepConfig, is_on: bool) -> None:
        """Without `is_on`, only look for a first wall."""
        self._config, self._is_on = config, is_on
        self._visited = Spots(config.near_m)
        self._left: list[LeftPlace] = []

    @property
    def left(self) -> tuple[LeftPlace, ...]:
        """The borders of unseen floor that were visited, or not reached, and why each visit ended."""
        return tuple(self._left)

    def was_in_vain(self, place_world: Float[ndarray, "2"]) -> bool:
        """Return whether going there was of no use before."""
        return self._visited.count(place_world) >= self._config.visits

    def ended(self, place: Place, trouble: str) -> None:
        """Take note that the visit of a place ended, and what was in the way, if anything."""
        self._visited.add(place.centre_world)
        self._left.append(LeftPlace(place.centre_world, trouble))

    def choose(self, situation: Situation) -> Choice | None:
        """Go to the nearest floor that borders on unseen floor; when none is left, to what is no wall of the map."""
        if not len(situation.map):
            return nearest_unseen(situation, "no wall is in sight yet")
        if not self._is_on:
            return None
        unseen = nearest_unseen(situation, "every chain is done, unseen floor is left")
        return unseen or nearest_unexplained(situation, "every chain is done, things stand that are no wall of the map")
