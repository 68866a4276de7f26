"""The errand at an open end: the places from which it is looked at, one after the other."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from chainslam.slam.map.chains import OpenEnd

from ..planning.paths import Planner
from ..survey.viewpoints import LOOKS, ideal_places, lane, places_beyond, places_near, places_that_see
from .behaviour import Behaviour
from .surroundings import Surroundings
from .wall_following import Errand, FollowingConfig

NO_PLACE = np.zeros((0, 2))


class EndErrand(Errand):
    """Looks at one open end from several places: follow the wall to it, past it, round it, and close."""

    def __init__(self, end: OpenEnd, route: tuple[int, ...], config: FollowingConfig) -> None:
        super().__init__(config)
        self.end = end
        self.route = route
        self._on_route = False
        self._visited: list[Float[np.ndarray, 2]] = []

    def follow(self, end: OpenEnd) -> None:
        """Take note of where the end is now; one that has moved on is looked at afresh."""
        if np.hypot(*(end.position_world - self.end.position_world)) > self._config.moved_m:
            self.end = end
            self._stage, self._failures, self.looks_done = 0, 0, 0
            self._shortest_m, self._stalled = np.inf, 0
            self._pilot = None
            self._visited = []

    @property
    def behaviour(self) -> Behaviour:
        """To a viewpoint, or along a wall of the route to it."""
        return Behaviour.FOLLOW if self._on_route else Behaviour.LOOK

    def _arrived(self) -> bool:
        if self._on_route:
            self._on_route = False
            self._shortest_m, self._stalled = np.inf, 0
            return False
        super()._arrived()
        return True

    def _plan(self, around: Surroundings) -> bool:
        planner = self._planner(around, self._config.window_m)
        ideal = ideal_places(self.end, around.walls, self._config.viewpoints)
        whole: Planner | None = None
        while self._stage < len(LOOKS):
            places = self._fresh(
                places_near(ideal[self._stage], self.end, around.free_space, planner, self._config.viewpoints)
            )
            self.doing = f"to look {LOOKS[self._stage]} the open end of wall {self.end.wall}"
            if self._drive(around, planner, places):
                return self._note()
            if self._stage == 0 and self._follow_route(around, planner):
                return True
            whole = whole or self._planner(around, None)
            places = self._fresh(
                places_near(ideal[self._stage], self.end, around.free_space, whole, self._config.viewpoints)
            )
            if self._drive(around, whole, places) or self._plan_beyond(around, whole):
                return self._note()
            self._stage += 1
        return self.looks_done == 0 and self._plan_anywhere(around, whole or self._planner(around, None))

    def _fresh(self, places: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
        """Keep the places that are not where an earlier look was made."""
        for visited in self._visited:
            places = places[np.hypot(*(places - visited).T) > self._config.apart_m]
        return places

    def _note(self) -> bool:
        assert self._pilot is not None
        self._visited.append(self._pilot.destination_world)
        return True

    def _follow_route(self, around: Surroundings, planner: Planner) -> bool:
        """Approach the wall farthest along the route to which a way is known nearby."""
        present = set(around.walls.ids.tolist())
        for wall in reversed(self.route[1:]):
            along = lane(wall, around.walls, self._config.viewpoints.standoff_m) if wall in present else NO_PLACE
            if self._drive(around, planner, along):
                self._on_route = True
                self.route = self.route[self.route.index(wall) :]
                self.doing = f"along wall {wall} towards wall {self.end.wall}"
                return True
        return False

    def _plan_beyond(self, around: Surroundings, planner: Planner) -> bool:
        """Nobody can stand near the ideal place past the end: one farther off will do."""
        if LOOKS[self._stage] not in ("past", "round"):
            return False
        places = places_beyond(self.end, around.walls, around.free_space, planner, self._config.viewpoints)
        return self._drive(around, planner, self._fresh(places))

    def _plan_anywhere(self, around: Surroundings, planner: Planner) -> bool:
        """No ideal place can be reached: any place that sees the end will do."""
        for reach in (self._config.viewpoints.near_m, self._config.viewpoints.farthest_m(around.scan.range_max_m)):
            places = places_that_see(self.end, around.free_space, planner, reach, self._config.viewpoints)
            if self._drive(around, planner, self._fresh(places)):
                self.doing = f"to where the open end of wall {self.end.wall} can be seen"
                return self._note()
        self.trouble = self.trouble or self._no_way or "no place that the robot can reach sees it"
        return False
