"""Next to actual position: the open end closest to the robot (paper, section 3.3 and figure 5)."""

from .nearest import nearest_end
from .strategy import Choice, Situation


class NearestRobot:
    """Goes to the open end that is the shortest drive away, which leads to a depth-first search."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the nearest open end by driving distance."""
        metres = situation.end_metres
        best = nearest_end(situation, metres)
        if best is None:
            return None
        reason = f"nearest of {len(metres)} open ends, {metres[best]:.1f} m to drive"
        return Choice(situation.open_ends[best], reason)
