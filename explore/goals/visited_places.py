"""A memory of places: how often something happened near here."""

import numpy as np
from jaxtyping import Float


class Spots:
    """Counts what happened near a place."""

    def __init__(self, reach_m: float) -> None:
        """Take places within `reach_m` of each other for one."""
        self._reach_m = reach_m
        self._places = np.zeros((0, 2))

    def add(self, place_world: Float[np.ndarray, "2"]) -> None:
        """Note that it happened here, m."""
        self._places = np.vstack([self._places, place_world])

    def count(self, place_world: Float[np.ndarray, "2"]) -> int:
        """Return how often it happened near a place, m."""
        return int(np.count_nonzero(np.hypot(*(self._places - place_world).T) < self._reach_m))
