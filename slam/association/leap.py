"""A place elsewhere in the map, where a robot may have been carried: believed once two scans, of two places, say so.

Buildings repeat themselves: one scan may fit a room that the robot never entered. From another place a room that is
only alike fits less well, and where it fits somewhere else again, the leap begins anew.
"""

import numpy as np
from jaxtyping import Float

from ..geometry.poses import compose
from ..robot import Odometry
from .place_search import PlaceSearchConfig, apart


class Leap:
    """Keeps the place that one scan has shown, and carries it along with the odometry."""

    def __init__(self, config: PlaceSearchConfig) -> None:
        self._config = config
        self._place: Float[np.ndarray, 3] | None = None
        self._way_m = 0.0

    @property
    def is_pending(self) -> bool:
        """Whether a second scan is to say whether the robot is where one has shown it."""
        return self._place is not None

    def move(self, odometry: Odometry) -> None:
        """Take note that the scanner has moved."""
        if self._place is not None:
            self._place = compose(self._place, odometry.motion)
            self._way_m += float(np.hypot(*odometry.motion[:2]))

    def drop(self) -> None:
        """Forget the place: the robot is where it was believed to be."""
        self._place, self._way_m = None, 0.0

    def is_earned(self, place: Float[np.ndarray, "3"], may_begin: bool) -> bool:
        """Return whether a scan shows the place that another scan had shown, as far away as two places are apart.

        Where it shows another one, the leap begins anew with this if it `may_begin`.
        """
        if self._place is None or apart(place[None], self._place, self._config)[0]:
            self._place, self._way_m = (place if may_begin else None), 0.0
            return False
        return self._way_m >= self._config.apart_m
