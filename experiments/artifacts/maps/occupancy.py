"""The robot's own free space as a ROS map: `map.pgm`, a grey picture, and `map.yaml`, which says where it lies."""

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float, Int8, Integer

from chainslam.explore.floor.free_space import FreeSpace

FREE, UNKNOWN, OCCUPIED = 254, 205, 0
"""The greys of ROS map_server's map_saver."""
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
BORDER_CELLS = 4
"""Unknown cells kept around all that was seen."""


def occupancy_files(free_space: FreeSpace, start_world: Float[np.ndarray, "3"]) -> tuple[bytes, bytes]:
    """Return the bytes of `map.pgm` and `map.yaml`; raises ValueError where nothing was seen.

    The first row of the picture is the one farthest up; the origin is the outer corner of its lower left pixel,
    in the world frame of the map. `start_world` goes into a comment.
    """
    cells, (x, y) = _seen(free_space)
    grey = np.where(cells < 0, FREE, np.where(cells > 0, OCCUPIED, UNKNOWN)).astype(np.uint8)[::-1]
    head = f"P5\n# metres: {free_space.config.cell_m:g} a pixel\n{grey.shape[1]} {grey.shape[0]}\n255\n"
    start = ", ".join(f"{value:.4f}" for value in start_world)
    words = (
        f"# seen by the robot, at the poses that it estimated; it started at [{start}] (x m, y m, heading rad)\n"
        "image: map.pgm\n"
        "mode: trinary\n"
        f"resolution: {free_space.config.cell_m:g}\n"
        f"origin: [{x:.6g}, {y:.6g}, 0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH:g}\n"
        f"free_thresh: {FREE_THRESH:g}\n"
    )
    return head.encode() + grey.tobytes(), words.encode()


Message = TypeVar("Message")


@dataclass(frozen=True)
class OccupancyGrid:
    """The content of a `nav_msgs/OccupancyGrid`."""

    resolution_m: float
    origin: tuple[float, float]
    """Outer corner of the first cell, m, in the map's frame."""
    cells: Int8[np.ndarray, "h w"]
    """Rows by ascending y, columns by ascending x: 0 free, 100 occupied, -1 unknown."""

    def written(self, message: Message, frame: str = "map") -> Message:
        """Fill and return an empty message of this type."""
        filled: Any = message
        filled.header.frame_id, filled.info.resolution = frame, float(self.resolution_m)
        filled.info.height, filled.info.width = self.cells.shape
        filled.info.origin.position.x, filled.info.origin.position.y = self.origin
        filled.info.origin.orientation.w = 1.0
        filled.data = [int(cell) for cell in self.cells.ravel()]
        return message


def occupancy_grid(free_space: FreeSpace) -> OccupancyGrid:
    """Return the floor as a ROS grid; raises ValueError if nothing was seen."""
    cells, origin = _seen(free_space)
    told = np.where(cells < 0, 0, np.where(cells > 0, 100, -1)).astype(np.int8)
    return OccupancyGrid(free_space.config.cell_m, origin, told)


def _seen(free_space: FreeSpace) -> tuple[Integer[np.ndarray, "h w"], tuple[float, float]]:
    """Return the evidence of all that was seen, and the lower left corner; raises ValueError where that is nothing."""
    evidence = np.where(free_space.beyond, 0, free_space.evidence)
    seen = np.argwhere(evidence != 0)
    if not len(seen):
        raise ValueError("expected floor seen by the robot, found none: the run kept no free space")
    low = np.maximum(seen.min(axis=0) - BORDER_CELLS, 0)
    high = np.minimum(seen.max(axis=0) + 1 + BORDER_CELLS, evidence.shape)
    x, y = free_space.origin_world + low[::-1] * free_space.config.cell_m
    return evidence[low[0] : high[0], low[1] : high[1]], (float(x), float(y))
