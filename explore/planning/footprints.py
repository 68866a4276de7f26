"""Where a body with an outline fits, by its heading."""

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Int

from chainslam.slam.geometry.compiled import compiled
from chainslam.slam.geometry.poses import rotation
from chainslam.slam.robot import RobotSpec
from chainslam.slam.robot.body import reaches_m

AHEAD = np.array(
    [[1, 0], [2, 1], [1, 1], [1, 2], [0, 1], [-1, 2], [-1, 1], [-2, 1],
     [-1, 0], [-2, -1], [-1, -1], [-1, -2], [0, -1], [1, -2], [1, -1], [2, -1]]
)  # fmt: skip
"""The headings that are told apart, each as the next cell straight ahead (columns and rows on)."""
HEADINGS_RAD = np.arctan2(AHEAD[:, 1], AHEAD[:, 0])
EVEN_M = 1e-4
"""What lies as far off as asked for, does."""


@lru_cache(maxsize=16)
def footprints(
    robot: RobotSpec, cell_m: float, beyond_m: float
) -> tuple[Int[np.ndarray, "c 2"], Int[np.ndarray, " h1"]]:
    """Return the cells (row, column from the body's own) under a body and so far beyond it, heading by heading.

    Those of heading h stand from the h-th of the second on. A cell is under it where its centre is.
    """
    reach = int(np.ceil((robot.radius_m + max(beyond_m, 0.0)) / cell_m)) + 1
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
    centres = cell_m * np.column_stack([columns, rows]).astype(np.float64)
    under = [
        reaches_m(centres @ rotation(float(heading)), robot) < robot.radius_m + beyond_m - EVEN_M
        for heading in HEADINGS_RAD
    ]
    cells = [np.column_stack([rows[each], columns[each]]) for each in under]
    return np.concatenate(cells), np.cumsum([0, *map(len, cells)])


@compiled
def fitting(
    occupied: Bool[np.ndarray, "h w"],
    cells: Int[np.ndarray, "n 2"],
    footprint: Int[np.ndarray, "c 2"],
    starts: Int[np.ndarray, " h1"],
) -> Bool[np.ndarray, "n k"]:
    """Return in which of the cells (row, column) a body fits with each heading: no occupied one is under it."""
    fits = np.ones((len(cells), len(starts) - 1), dtype=np.bool_)
    for n in range(len(cells)):
        for k in range(len(starts) - 1):
            for i in range(starts[k], starts[k + 1]):
                r, c = cells[n, 0] + footprint[i, 0], cells[n, 1] + footprint[i, 1]
                if 0 <= r < occupied.shape[0] and 0 <= c < occupied.shape[1] and occupied[r, c]:
                    fits[n, k] = False
                    break
    return fits


def heading_of(heading_rad: float) -> int:
    """Return the nearest of the headings."""
    return int(np.argmin(np.abs(np.angle(np.exp(1j * (HEADINGS_RAD - heading_rad))))))


def rooms_of(
    occupied: Bool[np.ndarray, "h w"], cells: Int[np.ndarray, "n 2"], robot: RobotSpec, cell_m: float, beyond_m: float
) -> Bool[np.ndarray, "n k"]:
    """Return in which cells, with which headings, a body has so much room all around."""
    return fitting(occupied, np.ascontiguousarray(cells), *footprints(robot, cell_m, beyond_m))
