"""What was given up is tried again where what was in the way may be gone: an end, the floor or a thing has moved."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from chainslam.slam.map.chains import OpenEnd

from ..following.surroundings import Surroundings
from ..survey.frontiers import known_floor
from ..survey.moving_things import moving_returns
from .explorer_config import ExplorerConfig
from .ledger import Event, Key, Ledger

Ends = Mapping[Key, OpenEnd]


class SecondTries:
    """Takes up what the ledger holds as given up."""

    def __init__(self, config: ExplorerConfig) -> None:
        self._config = config
        self._moving_scans = 0
        self.start_over(Ledger(config.near_m))

    def start_over(self, ledger: Ledger) -> None:
        """Go by another ledger, of which nothing was tried again; that something moves stays known."""
        self._ledger = ledger
        self.gave_up_s, self.used = -np.inf, 0

    def watch(self, around: Surroundings) -> None:
        """Take note of whether the scan shows something that moved."""
        moving = moving_returns(around.scan, around.free_space, around.walls, self._config.robot.scanner)
        self._moving_scans += bool(len(moving))

    @property
    def has_seen_moving(self) -> bool:
        """Whether something moved in so many scans that it may be what is in the way."""
        return self._moving_scans >= self._config.moving_scans

    def take_up_moved(self, ends: Ends) -> None:
        """Take up the ends that have moved since they were set aside."""
        for key, aside in self._ledger.set_aside.items():
            end = ends.get(key)
            if end is None:
                continue
            moved_m = np.hypot(*(end.position_world - aside.position_world))
            if moved_m > self._config.moved_m and not self._is_hopeless(end.position_world):
                self._ledger.take_up(key)

    def take_up_known(self, around: Surroundings, ends: Ends) -> None:
        """Take up the ends at which no look was possible, where more of the floor is known now."""
        reach = self._config.following.viewpoints.near_m
        for key, before in self._ledger.unlooked():
            if key not in ends or self._is_hopeless(ends[key].position_world):
                continue
            if known_floor(around.free_space, ends[key].position_world, reach) > (1.0 + self._config.grown) * before:
                self._ledger.take_up_unlooked(key)

    def take_up_all(self, around: Surroundings, ends: Ends) -> bool:
        """Take up all that is left, some time after the last of it was given up, if something moved.

        Returns whether the robot is to wait for that, or for the scan after it: False once it has tried often enough.
        """
        given_up = self._ledger.given_up
        is_left = bool(given_up.keys & ends.keys()) or any(place.trouble for place in given_up.places)
        if not (self.has_seen_moving and is_left and self.used < self._config.again):
            return False
        if around.scan.time_s >= self.gave_up_s + self._config.wait_s:
            self.used += 1
            self._ledger.take_up_all()
            around.free_space.forget_too_tight()
        return True

    def _is_hopeless(self, place: Float[np.ndarray, 2]) -> bool:
        return self._ledger.count(Event.SET_ASIDE, place) >= self._config.attempts
