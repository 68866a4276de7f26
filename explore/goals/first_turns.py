"""A mission begins with some turns on the spot."""

from __future__ import annotations

import networkx as nx

from chainslam.slam.map.chains import Chain

from ..following.driving import spin
from ..following.driving_config import DrivingConfig
from ..following.surroundings import Surroundings
from .decider import Decision
from .explorer import Explorer

FIRST_TURNS = 4


class FirstTurns:
    """An explorer before whose first decision the robot turns: only turns show where on the body the scanner sits.

    A scanner that sits elsewhere than stated is noticed before the robot drives past anything.
    """

    def __init__(self, explorer: Explorer, driving: DrivingConfig) -> None:
        self._explorer, self._driving, self._left = explorer, driving, FIRST_TURNS

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return the next of the first turns, or what the explorer says."""
        if not self._left:
            return self._explorer.decide(around, chains, graph)
        self._left -= 1
        self._explorer.watch(around)
        return Decision(spin(around, 1.0, self._driving), "first turns on the spot: does the scanner sit as stated")

    def interrupt(self, around: Surroundings) -> None:
        """Take note that the robot was led away from its errand."""
        self._explorer.interrupt(around)

    def start_over(self) -> None:
        """Forget what was given up; the first turns are not repeated."""
        self._explorer.start_over()
