"""A building: its free space, its faces, and what a robot can reach and see of it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from jaxtyping import Float, Int
from shapely.geometry.base import BaseGeometry

from chainslam.slam.robot import RobotSpec

from .contour import Contour, visible_contour

ROBOT_RADIUS_M = RobotSpec().radius_m
SENSOR_RANGE_M = 4.0


@dataclass(frozen=True)
class Reading:
    """How a drawing was read, in words: the interpretation of its parts, and the source of scale and start."""

    understood: str
    scale: str
    start: str
    notes: tuple[str, ...] = ()
    """Parts that were left out or not understood, in words."""


@dataclass(frozen=True, eq=False)
class World:
    """The true building; walls are solid."""

    name: str
    free: shapely.Polygon
    """The connected free region that contains the start; the free side is on the left of every directed edge."""
    start: Float[np.ndarray, "3"]
    """Pose (x m, y m, heading rad) in the world frame."""
    labels: dict[str, tuple[float, float]]
    """Named points, m, world frame."""
    reading: Reading | None = None
    """None for a world without a drawing."""
    fence: shapely.Polygon | None = None
    """Where the robot must stay; None without a limit."""

    @cached_property
    def faces(self) -> Float[np.ndarray, "n 2 2"]:
        """All wall faces as directed edges, m, world frame, ring by ring (the exterior first), in ring order."""
        rings = [shapely.get_coordinates(ring) for ring in self._rings]
        return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])

    @cached_property
    def face_rings(self) -> Int[np.ndarray, " n"]:
        """The ring of each face; 0 is the exterior."""
        counts = [len(ring.coords) - 1 for ring in self._rings]
        return np.repeat(np.arange(len(counts)), counts)

    @property
    def _rings(self) -> list[shapely.LinearRing]:
        return [self.free.exterior, *self.free.interiors]

    @cached_property
    def floor(self) -> BaseGeometry:
        """The free region within the fence."""
        return self.free if self.fence is None else shapely.intersection(self.free, self.fence)

    def reachable(self, radius_m: float = ROBOT_RADIUS_M) -> shapely.Polygon:
        """Return the positions that the centre of a disc of this radius can reach from the start."""
        room = self.free.buffer(-radius_m, quad_segs=16)
        floor = room if self.fence is None else shapely.intersection(room, self.fence.buffer(-radius_m))
        inner = shapely.get_parts(floor)
        inner = inner[shapely.get_type_id(inner) == shapely.GeometryType.POLYGON]
        at = shapely.Point(self.start[:2])
        return inner[int(np.argmin(shapely.distance(inner, at)))] if len(inner) else shapely.Polygon()

    def reachable_contour(
        self, radius_m: float = ROBOT_RADIUS_M, range_m: float = SENSOR_RANGE_M, scanner_m: float = 0.0
    ) -> Contour:
        """Return the parts of the faces in line of sight within range of a reachable scanner position.

        Of its `rings` those that leave the fence are left out. The scanner is `scanner_m` from the middle of the disc,
        in any direction.
        """
        lookouts, off_m = self.lookouts(radius_m, scanner_m), min(scanner_m, radius_m)
        seen = visible_contour(self.faces, self.face_rings, lookouts, radius_m - off_m, range_m)
        if self.fence is None:
            return seen
        # A ring that leaves the fence ends there for the robot, so that no chain can close it.
        within = [ring for ring in seen.rings if self.fence.covers(self._rings[ring])]
        return replace(seen, rings=np.array(within, dtype=np.int64))

    def lookouts(self, radius_m: float, scanner_m: float) -> shapely.Polygon:
        """Return the possible positions of a scanner this far from the middle of a disc, at most on its rim."""
        reachable, off_m = self.reachable(radius_m), min(scanner_m, radius_m)
        return reachable if off_m <= 0.0 or reachable.is_empty else reachable.buffer(off_m, quad_segs=16)
