"""Follow one wall to its end, round it, and back along the wall to the other end (paper, section 3.1)."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.map.chains import HEAD, TAIL, OpenEnd

from ..planning.paths import Planner
from ..survey.viewpoints import LOOKS, ideal_places, lane, places_near
from .behaviour import Behaviour
from .surroundings import Surroundings
from .wall_following import Errand, FollowingConfig

ROUNDING = LOOKS[:3]
"""In front of the end, past it, round it: as far as a motion free of collision is possible."""


class WallErrand(Errand):
    """Ping-pong along one wall, once to each end; it does not matter where the robot began to follow it."""

    def __init__(self, wall: int, side: int | None, config: FollowingConfig) -> None:
        """Follow `wall` towards `side` first (`TAIL` or `HEAD`); without a side, towards the nearer end."""
        super().__init__(config)
        self._wall = wall
        self._first = side

    @property
    def behaviour(self) -> Behaviour:
        """Along the wall, or round its end."""
        return Behaviour.ROUND if self._stage % len(ROUNDING) else Behaviour.FOLLOW

    def _plan(self, around: Surroundings) -> bool:
        if self._wall not in around.walls.ids:
            self.trouble = f"wall {self._wall} is no longer in the map"
            return False
        ends = around.walls.ends_world[around.walls.belief.rows([self._wall])[0]]
        if self._first is None:
            gaps = np.hypot(*(ends - around.pose_world[:2]).T)
            self._first = TAIL if gaps[TAIL] <= gaps[HEAD] else HEAD
        planner = self._planner(around, None)
        while self._stage < 2 * len(ROUNDING):
            turned_back, part = divmod(self._stage, len(ROUNDING))
            side = self._first if not turned_back else TAIL + HEAD - self._first
            self.doing = f"along wall {self._wall} {('towards', 'past', 'round')[part]} its {('tail', 'head')[side]}"
            if self._drive(around, planner, self._places(part, OpenEnd(self._wall, side, ends[side]), around, planner)):
                return True
            self._stage += 1
        return False

    def _places(self, part: int, end: OpenEnd, around: Surroundings, planner: Planner) -> Float[np.ndarray, "n 2"]:
        """Return where to go for one part of the rounding; towards the end, as far along the wall as there is a way."""
        config = self._config.viewpoints
        places = places_near(ideal_places(end, around.walls, config)[part], end, around.free_space, planner, config)
        if part > 0 or self._way(around, planner, places) is not None:
            return places
        along = lane(self._wall, around.walls, config.standoff_m)
        for place in along[:: -1 if end.side == HEAD else 1]:
            if self._way(around, planner, place[None]) is not None:
                return place[None]
        return places
