"""Decides nothing while earlier sessions are played, then hands over to the explorer of a later one."""

from __future__ import annotations

from collections.abc import Callable

import networkx as nx

from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import MotionCommand, Odometry

from ..following.surroundings import Surroundings
from .decider import Decision, Driver


class LaterSession:
    """Goes through a known number of recorded scans, and begins to explore at the scan after them."""

    def __init__(self, explorer: Callable[[], Driver], recorded: int) -> None:
        """`explorer` makes the driver once the robot stands where the later session goes on."""
        self._make, self._left = explorer, recorded
        self._driver: Driver | None = None

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return a command that nobody obeys, or the explorer's decision."""
        if self._left:
            self._left -= 1
            return Decision(MotionCommand(0.0, 0.0), "replaying the earlier session")
        self._driver = self._driver or self._make()
        return self._driver.decide(around, chains, graph)

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of what the odometry reported of the explorer's commands."""
        if self._driver is not None:
            self._driver.moved(command, odometry)
