"""In the place of the explorer where somebody else drove: it decides nothing and goes on to the end of a recording."""

from __future__ import annotations

import networkx as nx

from slam.map.chains import Chain
from slam.robot import MotionCommand, Odometry

from ..following.wall_following import Surroundings
from ..outcome import Outcome
from .decider import Decision
from .lost import LostConfig


class ReplayDriver:
    """Goes through a known number of scans; a robot that stays lost at the end for a turn's steps has failed."""

    def __init__(self, scans: int, lost: LostConfig) -> None:
        self._scans, self._step, self._lost_since, self._lost = scans, -1, -1, lost

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return a command that nobody obeys, or the end after the last scan."""
        self._step += 1
        if not around.is_lost:
            self._lost_since = -1
        elif self._lost_since < 0:
            self._lost_since = self._step
        if self._step + 1 < self._scans:
            return Decision(MotionCommand(0.0, 0.0), "replaying")
        if self._lost_since < 0:
            return Decision(None, "the recording has ended", outcome=Outcome.RECORDING_ENDED)
        if self._step + 1 - self._lost_since >= self._lost.steps:
            words = f"lost at step {self._lost_since}: no scan after it fits the map, to the end of the recording"
            return Decision(None, words, outcome=Outcome.FAILED)
        words = f"the recording has ended; lost since step {self._lost_since}"
        return Decision(None, words, outcome=Outcome.RECORDING_ENDED)

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of nothing: the recording knows where it goes on."""
