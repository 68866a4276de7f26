"""A run's map, read from its files: corners, walls and closed chains, with the joint covariance of all walls."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from ...scoring.maps.measurements import (
    CornerPoints,
    Measured,
    area,
    corner_jacobian,
    corner_points,
    distance,
    perimeter,
)
from ...usage import UsageError
from .map_files import read_joint


@dataclass(frozen=True)
class Room:
    """A closed chain: the inside of a room, or the outside of an object in one."""

    chain: int
    corners: tuple[int, ...]
    """Ids of its corners, in order, with the free side on the left."""
    is_island: bool
    """Whether the free side is outside."""


@dataclass(frozen=True)
class MappedCorners:
    """The corners of a map; their names are the ids in `map.geojson`, from 0."""

    points: CornerPoints
    walls: tuple[tuple[int, int], ...]
    """Ids of the two walls that meet at each corner."""
    chains: tuple[int, ...]
    """The chain of each corner."""
    sharp: tuple[bool, ...]
    """Whether its walls cross at a clear angle; the other corners are not known along their walls."""
    rooms: tuple[Room, ...]

    def __len__(self) -> int:
        return len(self.walls)

    def named(self, name: str, folder: Path) -> int:
        """Return a corner by its name; raises UsageError for an unknown one, and for one whose walls are collinear."""
        corners = {str(k): k for k in range(len(self))}
        if name not in corners:
            known = f"0 to {len(self) - 1}" if corners else "none"
            raise UsageError(f"expected a corner from {known}, found {name!r}: see `chainslam measure {folder}`")
        if not self.sharp[corners[name]]:
            raise UsageError(
                f"expected a corner of two walls that cross, found collinear ones at corner {name}: choose another"
            )
        return corners[name]

    def distance(self, first: int, second: int) -> Measured:
        """Return the distance between two corners."""
        return distance(self.points, first, second)

    def area(self, room: Room) -> Measured:
        """Return the area of a closed chain, m^2."""
        return area(self.points, room.corners)

    def perimeter(self, room: Room) -> Measured:
        """Return the length of a closed chain, m."""
        return perimeter(self.points, room.corners)

    def sides(self, room: Room) -> list[tuple[int, int, Measured]]:
        """Return the length of each wall of a closed chain, between its two corners."""
        after = (*room.corners[1:], room.corners[0])
        return [(a, b, self.distance(a, b)) for a, b in zip(room.corners, after, strict=True)]


def read_corners(folder: Path) -> MappedCorners:
    """Read `map.npz` and `map.geojson` of a run; raises UsageError for anything else."""
    arrays, features = read_joint(folder)
    return corners_of(arrays, features["corner"], features["chain"])


def corners_of(
    arrays: Mapping[str, Any], found: Sequence[Mapping[str, Any]], chains: Sequence[Mapping[str, Any]]
) -> MappedCorners:
    """Return the corners of a map from what `map.npz` and the features of `map.geojson` hold."""
    row_of = {int(wall): row for row, wall in enumerate(arrays["ids"])}
    positions = np.array([f["geometry"]["coordinates"] for f in found], dtype=np.float64).reshape(-1, 2)
    jacobians = np.zeros((len(found), 2, len(arrays["cov"])))
    sharp = []
    for k, feature in enumerate(found):
        rows = [row_of[int(wall)] for wall in feature["properties"]["walls"]]
        own, crosses = corner_jacobian(arrays["lines"][rows], arrays["anchors"][rows], positions[k])
        for row, part in zip(rows, (own[:, :2], own[:, 2:]), strict=True):
            jacobians[k, :, 3 + 2 * row : 5 + 2 * row] += part
        sharp.append(crosses)
    names = [int(f["properties"]["chain"]) for f in found]
    rooms = [_room(int(f["properties"]["chain"]), names, positions) for f in chains if f["properties"]["closed"]]
    return MappedCorners(
        corner_points(positions, jacobians, arrays["cov"]),
        tuple((int(a), int(b)) for a, b in (f["properties"]["walls"] for f in found)),
        tuple(names),
        tuple(sharp),
        tuple(room for room in rooms if room.corners),
    )


def _room(chain: int, names: list[int], positions: Float[np.ndarray, "n 2"]) -> Room:
    mine = tuple(k for k, name in enumerate(names) if name == chain)
    points = positions[list(mine)]
    after = np.roll(points, -1, axis=0)
    return Room(chain, mine, bool(np.sum(points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]) < 0.0))
