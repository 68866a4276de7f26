"""The errand at an open end: the places from which it is looked at, one after the other."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from chainslam.slam.map.chains import OpenEnd

from ..planning.paths import Planner
from ..survey.viewpoints import LOOKS, ideal_places, places_beyond, places_near, places_that_see
from .surroundings import Surroundings
from .wall_following import Errand, FollowingConfig

BEYOND = ("past", "round")
"""Where nobody can stand near the ideal place of these looks, one farther off will do."""


class EndErrand(Errand):
    """Looks at one open end from several places: in front of it, past it, round it, and close."""

    def __init__(self, end: OpenEnd, config: FollowingConfig) -> None:
        super().__init__(config)
        self.end = end
        self._visited: list[Float[np.ndarray, 2]] = []

    def follow(self, end: OpenEnd) -> None:
        """Take note of where the end is now; one that has moved on is looked at afresh."""
        if np.hypot(*(end.position_world - self.end.position_world)) > self._config.moved_m:
            self.end = end
            self._stage, self._failures, self.looks_done = 0, 0, 0
            self._pilot = None
            self._visited = []

    def _arrived(self) -> bool:
        super()._arrived()
        return True

    def _plan(self, around: Surroundings) -> bool:
        config, floor = self._config.viewpoints, around.free_space
        ideal = ideal_places(self.end, around.walls, config)
        near, whole = self._planner(around, self._config.window_m), None
        while self._stage < len(LOOKS):
            self.doing = f"to look {LOOKS[self._stage]} the open end of wall {self.end.wall}"
            if self._look_from(places_near(ideal[self._stage], self.end, floor, near, config), around, near):
                return True
            whole = whole or self._planner(around, None)
            if self._look_from(places_near(ideal[self._stage], self.end, floor, whole, config), around, whole):
                return True
            farther = LOOKS[self._stage] in BEYOND
            if farther and self._look_from(places_beyond(self.end, around.walls, floor, whole, config), around, whole):
                return True
            self._stage += 1
        if self.looks_done:
            return False
        whole = whole or self._planner(around, None)
        for reach_m in (config.near_m, config.farthest_m(around.scan.range_max_m)):
            if self._look_from(places_that_see(self.end, floor, whole, reach_m, config), around, whole):
                self.doing = f"to where the open end of wall {self.end.wall} can be seen"
                return True
        self.trouble = self.trouble or self._no_way or "no place that the robot can reach sees it"
        return False

    def _look_from(self, places: Float[np.ndarray, "n 2"], around: Surroundings, planner: Planner) -> bool:
        """Set out for one of some places, but for those where an earlier look was made."""
        for visited in self._visited:
            places = places[np.hypot(*(places - visited).T) > self._config.apart_m]
        if not self._drive(around, planner, places):
            return False
        assert self._pilot is not None
        self._visited.append(self._pilot.destination_world)
        return True
