"""The track along one wall at a set distance: parallel to the wall, and on round each of its ends on a circle."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import normals
from chainslam.slam.map.stochastic_map import StochasticMap

from ..planning.paths import Field

AROUND_M, CELL_M = 0.8, 0.05
"""The part of the floor, to each side of the robot, on which the next steps are planned, and its cells."""
ASTRAY = 2.0
"""A metre nearer to the wall than the stand-off, or farther from it, is worth so many along it."""


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

    def locate(
        self, places_world: Float[np.ndarray, "*n 2"]
    ) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
        """Return positions and distances, m, of some places; behind the wall they belong to the nearer end."""
        offset = places_world - self.tail_world
        along, front = offset @ self.along, -(offset @ self.into)
        is_head = along > 0.5 * self.length_m
        past = np.where(is_head, along - self.length_m, -along)
        # Farther round than straight behind, the place lies along the wall again, on its other side.
        turn = np.arctan2(past, front)
        turned_m = self.standoff_m * np.where(turn >= -0.5 * np.pi, turn, turn + 2.0 * np.pi)
        beside = (front >= 0.0) & (past <= 0.0)
        position = np.where(beside, along, np.where(is_head, self.length_m + turned_m, -turned_m))
        return position, np.where(beside, front, np.hypot(past, front))

    def field(self, pose_world: Float[np.ndarray, "3"], onward: float) -> Field:
        """Return how far it is along the track, towards its head (`onward` 1) or tail (-1), from around a pose."""
        cells = int(np.ceil(AROUND_M / CELL_M))
        corner = pose_world[:2] - CELL_M * cells
        x, y = np.meshgrid(*(corner[:, None] + CELL_M * (np.arange(2 * cells) + 0.5)))
        here, _ = self.locate(pose_world[:2])
        position, distance = self.locate(np.stack([x, y], axis=-1))
        ahead = onward * (position - here)
        metres = AROUND_M + 1.0 - ahead + ASTRAY * np.abs(distance - self.standoff_m)
        # Behind the wall the way round one end meets that round the other.
        metres[(np.abs(ahead) > AROUND_M + 1.0) | (distance > 2.0 * self.standoff_m)] = np.inf
        return Field(metres[..., None], corner, CELL_M)

    def place(self, position_m: float, distance_m: float) -> Float[np.ndarray, "2"]:
        """Return the place at a position and a distance, world frame, m: the inverse of `locate`."""
        along = float(np.clip(position_m, 0.0, self.length_m))
        turn = (position_m - along) / self.standoff_m
        foot = self.tail_world + along * self.along
        return foot + distance_m * (np.sin(turn) * self.along - np.cos(turn) * self.into)

    def is_past_end(self, position_m: float) -> bool:
        """Return whether a position lies on the circle round an end."""
        return not 0.0 <= position_m <= self.length_m


def track_of(wall: int, walls: StochasticMap, standoff_m: float) -> Track:
    """Return the track of a wall of the map."""
    row = walls.belief.rows([wall])[0]
    tail, head = walls.ends_world[row]
    length = float(np.hypot(*(head - tail)))
    into = normals(walls.belief.lines_world[row, 0])
    along = np.array([-into[1], into[0]])
    return Track(tail, along, into, length, standoff_m)
