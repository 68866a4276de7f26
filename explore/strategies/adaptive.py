"""Turns back to well-known walls where the filter must be inconsistent, and else explores (paper, section 6)."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.estimation.gates import gate_level

from ..following.surroundings import Surroundings
from ..survey.viewpoints import ideal_places, lane
from .inconsistency import LEVEL, Monitor
from .nearest_robot import NearestRobot
from .strategy import Choice, Place, Situation

BAR = gate_level(LEVEL, 2)
"""The gate at which matching refuses a wall: an error expected to be as large as this enters it a second time."""


class Adaptive:
    """Explores like `nearest-robot`; where a known wall met again is predicted to be refused, turns back to one first.

    Each return is followed by an open end, so that there are never more returns than ends.
    """

    def __init__(self) -> None:
        self._forward = NearestRobot()
        self._monitor = Monitor()
        self._has_returned = False

    def watch(self, around: Surroundings) -> None:
        """Take note of one more scan."""
        self._monitor.watch(around)

    def choose(self, situation: Situation) -> Choice | None:
        """Return the nearest open end, or a place beside a well-known wall."""
        if self._has_returned:
            self._monitor.learn(situation.around.seen)
        choice = self._forward.choose(situation)
        if choice is None or isinstance(choice.target, Place):
            return choice
        row = next(k for k, end in enumerate(situation.open_ends) if end is choice.target)
        goal = ideal_places(choice.target, situation.map, situation.following.viewpoints)[0]
        metres = float(situation.nearest_end_metres[row])
        error = self._monitor.predicted(situation.around, goal, metres)
        if error > BAR and not self._has_returned:
            back = self._way_back(situation, error)
            if back is not None:
                self._has_returned = True
                return back
        self._has_returned = False
        return Choice(choice.target, f"{choice.reason}; known walls expected {np.sqrt(error):.1f} sigmas off")

    def _way_back(self, situation: Situation, error: float) -> Choice | None:
        """Return the nearest places beside a well-known wall."""
        walls, standoff_m = situation.map, situation.following.viewpoints.standoff_m
        known = [wall for wall in walls.ids[~walls.tentative].tolist() if wall in self._monitor.known]
        lanes: list[Float[np.ndarray, "n 2"]] = [lane(wall, walls, standoff_m) for wall in known]
        metres = np.array([situation.field.metres(points).min() for points in lanes])
        if not np.isfinite(metres).any():
            return None
        nearest = int(np.argmin(metres))
        place = Place(lanes[nearest], f"wall {known[nearest]} is well known", "known-walls")
        reason = f"known walls expected {np.sqrt(error):.1f} sigmas off: back, {metres[nearest]:.1f} m to drive"
        return Choice(place, reason)
