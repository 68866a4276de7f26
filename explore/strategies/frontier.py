"""The classical baseline: borders between seen and unseen floor instead of open ends of walls (paper, section 1)."""

from .nearest import nearest_frontier
from .nearest_robot import NearestRobot
from .strategy import Choice, Situation


class Frontier:
    """Goes to the nearest border of seen floor; when none is left, to the open ends that remain, nearest first."""

    def __init__(self) -> None:
        self._ends = NearestRobot()

    def choose(self, situation: Situation) -> Choice | None:
        """Return the nearest border by driving distance, else the nearest open end."""
        choice = nearest_frontier(situation, "frontier")
        if choice is not None:
            return choice
        end = self._ends.choose(situation)
        return end and Choice(end.target, f"no frontier is left; {end.reason}")
