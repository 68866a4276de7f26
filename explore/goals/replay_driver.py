"""In the place of the explorer where somebody else drove: it decides nothing and goes on to the end of a recording."""

from __future__ import annotations

import networkx as nx

from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import MotionCommand, Odometry

from ..following.surroundings import Surroundings
from ..outcome import Outcome
from .decider import Decision
from .lost import LostConfig

EARLY = "the recording ends early"


class ReplayDriver:
    """Goes through a known number of scans; a robot that stays lost at the end for a turn's steps has failed."""

    def __init__(self, scans: int, lost: LostConfig, cut_short: str = "", unread: str = "") -> None:
        """Go through `scans` scans.

        `cut_short` says in words what ended their drive early, and `unread` why most of their log was not read.
        """
        self._scans, self._step, self._lost_since, self._lost = scans, -1, -1, lost
        self._outcome = Outcome.RECORDING_CUT_SHORT if cut_short else Outcome.RECORDING_ENDED
        told_before = cut_short.startswith(EARLY)  # by a replay that is replayed
        if unread:
            self._outcome, cut_short = Outcome.FAILED, f"{EARLY}: {unread}"
            told_before = True
        self._words = cut_short if told_before else f"{EARLY} ({cut_short})" if cut_short else "the recording has ended"

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
            return Decision(None, self._words, outcome=self._outcome)
        if self._step + 1 - self._lost_since >= self._lost.steps:
            words = f"lost at step {self._lost_since}: no scan after it fits the map, to the end of the recording"
            return Decision(None, words, outcome=Outcome.FAILED)
        return Decision(None, f"{self._words}; lost since step {self._lost_since}", outcome=self._outcome)

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of nothing: the recording knows where it goes on."""
