"""Next to actual position: the open end closest to the robot (paper, section 3.3 and figure 5)."""

from .nearest import nearest_end
from .strategy import Choice, Situation


class NearestRobot:
    """Goes to the open end that is the shortest drive away, which leads to a depth-first search."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the nearest open end by driving distance."""
        best = nearest_end(situation)
        if best is None:
            return None
        metres = situation.nearest_end_metres[best]
        reason = f"nearest of {len(situation.open_ends)} open ends, {metres:.1f} m to drive"
        return Choice(situation.open_ends[best], reason)
