"""Next to actual position: the open end closest to the robot (paper, section 3.3 and figure 5)."""

from .strategy import Choice, Situation


class NearestRobot:
    """Goes to the open end that is the shortest drive away, which leads to a depth-first search."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return the nearest open end by driving distance."""
        found = situation.nearest(situation.candidates)
        if found is None:
            return None
        row, metres = found
        return Choice(
            situation.candidates[row],
            f"nearest of {len(situation.candidates)} open ends, {metres:.1f} m to drive",
        )
