"""What was given up is tried again after a while where something in the building moves: it may be out of the way."""

from __future__ import annotations

import numpy as np

from ..following.surroundings import Surroundings
from ..survey.moving_things import moving_returns
from .explorer_config import ExplorerConfig


class SecondTries:
    """Counts scans that show something moving, and the rounds in which all is tried again."""

    def __init__(self, config: ExplorerConfig) -> None:
        self._config = config
        self._moving_scans = 0
        self.start_over()

    def start_over(self) -> None:
        """Forget what was tried again; that something moves stays known."""
        self.gave_up_s, self.used = -np.inf, 0

    def watch(self, around: Surroundings) -> None:
        """Take note of whether the scan shows something that moved."""
        moving = moving_returns(around.scan, around.free_space, around.walls, self._config.robot.scanner)
        self._moving_scans += bool(len(moving))

    @property
    def has_seen_moving(self) -> bool:
        """Whether something moved in so many scans that it may be what is in the way."""
        return self._moving_scans >= self._config.moving_scans

    @property
    def may_be_had(self) -> bool:
        """Whether the robot is to wait for another round."""
        return self.has_seen_moving and self.used < self._config.again

    def are_due(self, around: Surroundings) -> bool:
        """Return whether another round begins, some time after the last goal was given up, and count it."""
        is_due = around.scan.time_s >= self.gave_up_s + self._config.wait_s
        self.used += is_due
        return is_due
