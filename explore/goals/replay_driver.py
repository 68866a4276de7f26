"""In the place of the explorer where somebody else drove: it decides nothing and goes on to the end of a recording."""

from __future__ import annotations

import networkx as nx

from slam.map.chains import Chain
from slam.robot import MotionCommand, Odometry

from ..following.wall_following import Surroundings
from ..outcome import Outcome
from .decider import Decision


class ReplayDriver:
    """Goes through a known number of scans."""

    def __init__(self, scans: int) -> None:
        self._left = scans

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return a command that nobody obeys, or the end after the last scan."""
        self._left -= 1
        if self._left > 0:
            return Decision(MotionCommand(0.0, 0.0), "riding along")
        return Decision(None, "the recording has ended", outcome=Outcome.RECORDING_ENDED)

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of nothing: the recording knows where it goes on."""
