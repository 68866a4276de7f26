"""In the place of the explorer where somebody else drives: it decides nothing and rides to the end of a recording."""

from __future__ import annotations

import networkx as nx

from slam.map.chains import Chain
from slam.robot import MotionCommand

from ..following.wall_following import Surroundings
from ..goal import Goal, LeftPlace, SetAside
from ..outcome import Outcome


class Passenger:
    """Rides along for a known number of scans."""

    def __init__(self, scans: int) -> None:
        self._left = scans
        self.set_aside: dict[tuple[int, int], SetAside] = {}
        self.still_open: tuple[SetAside, ...] = ()
        self.left_places: tuple[LeftPlace, ...] = ()
        self.needs_floor = False
        self.goal: Goal | None = None
        self.walls_to_follow: tuple[int, ...] = ()
        self.doing = "riding along"
        self.outcome = Outcome.RECORDING_ENDED
        self.closing_words = "the recording has ended"

    def command(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> MotionCommand | None:
        """Return a command that nobody obeys, or None after the last scan."""
        self._left -= 1
        return MotionCommand(0.0, 0.0) if self._left > 0 else None

    def interrupt(self, around: Surroundings) -> None:
        """Nothing of it is its own."""

    def start_over(self) -> None:
        """Nothing was given up."""
