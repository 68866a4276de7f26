"""The track along one wall at a set distance: parallel to the wall, and on round each of its ends on a circle."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import normals
from chainslam.slam.map.stochastic_map import StochasticMap


@dataclass(frozen=True, eq=False)
class Track:
    """Places beside a wall by (position, distance): position runs along the wall from tail to head.

    From 0 to `length_m` it is metres along the wall on its free side. Before and beyond, the track goes round the tail
    and the head on a circle of radius `standoff_m`: position goes on in metres along that circle, so that a quarter
    of it, pi/2 times the stand-off, lies straight past the end, and half of it behind the wall.
    """

    tail_world: Float[np.ndarray, "2"]
    along: Float[np.ndarray, "2"]
    """Unit vector from tail to head, world frame."""
    into: Float[np.ndarray, "2"]
    """Unit vector from the free side into the wall, world frame."""
    length_m: float
    standoff_m: float

    def locate(self, place_world: Float[np.ndarray, "2"]) -> tuple[float, float]:
        """Return position and distance (m, m) of a place; behind the wall it belongs to the nearer end."""
        offset = place_world - self.tail_world
        along, front = float(offset @ self.along), -float(offset @ self.into)
        past_head = along - self.length_m
        if front >= 0.0 and along >= 0.0 and past_head <= 0.0:
            return along, front
        if along > 0.5 * self.length_m:
            return self.length_m + self._round(past_head, front), float(np.hypot(past_head, front))
        return -self._round(-along, front), float(np.hypot(along, front))

    def place(self, position_m: float, distance_m: float) -> Float[np.ndarray, "2"]:
        """Return the place at a position and a distance, world frame, m: the inverse of `locate`."""
        along = float(np.clip(position_m, 0.0, self.length_m))
        turn = (position_m - along) / self.standoff_m
        foot = self.tail_world + along * self.along
        return foot + distance_m * (np.sin(turn) * self.along - np.cos(turn) * self.into)

    def is_past_end(self, position_m: float) -> bool:
        """Return whether a position lies on the circle round an end."""
        return not 0.0 <= position_m <= self.length_m

    def _round(self, past_m: float, front_m: float) -> float:
        """Return metres along the circle round an end of a place so far past it and so far in front of the wall."""
        turn = np.arctan2(past_m, front_m)
        # Farther round than straight behind, the place lies along the wall again, on its other side.
        return self.standoff_m * float(turn if turn >= -0.5 * np.pi else turn + 2.0 * np.pi)


def track_of(wall: int, walls: StochasticMap, standoff_m: float) -> Track:
    """Return the track of a wall of the map."""
    row = walls.belief.rows([wall])[0]
    tail, head = walls.ends_world[row]
    length = float(np.hypot(*(head - tail)))
    into = normals(walls.belief.lines_world[row, 0])
    along = np.array([-into[1], into[0]])
    return Track(tail, along, into, length, standoff_m)
