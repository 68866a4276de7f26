"""How much floor an explorer has not seen, by its occupancy grid alone, as an upper bound that holds with 95 %.

The bound is a split-conformal quantile: in plans that were explored for it, the share of unseen floor was held against
the length of the border between known and unknown floor (`studies.plans.unseen_floor`). It holds in buildings
that are like those plans, whoever explores them.
"""

from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from jaxtyping import Bool, Float, Int8
from msgspec import Struct
from msgspec.json import decode
from scipy.ndimage import binary_dilation, distance_transform_edt, label

from chainslam.explore.step import Step

FREE, UNKNOWN = 0, -1
OCCUPIED_FROM = 50
LEAST_CELLS = 4
"""A border of fewer cells is a gap between beams."""
CONFIDENCE = 0.95
TABLE = "unseen_floor.json"


@dataclass(frozen=True)
class UnseenFloor:
    """What a grid tells about floor that it does not show."""

    at_most_m2: float
    """With 95 % no more than this is unseen of what the robot could see of the building."""
    seen_m2: float
    """Free floor in the grid."""
    frontier_m: float
    """Length of the border between floor that the robot can drive to and unknown cells."""

    @property
    def reach(self) -> float:
        """The border in units of the seen floor, without dimension."""
        return self.frontier_m / np.sqrt(self.seen_m2)


class Bound(Struct):
    """The calibration: unseen over seen floor at 95 %, which grows with the root of the reach."""

    closed: float
    """Where there is no border."""
    open: float
    """Where there is one, of the root of the reach."""
    runs: int
    """Number of runs that it comes from."""

    def share(self, reach: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Return the largest share of unseen over seen floor."""
        return np.asarray(np.where(reach > 0.0, np.maximum(self.open * np.sqrt(reach), self.closed), self.closed))


def unseen_floor(
    grid: Int8[np.ndarray, "h w"], cell_m: float, robot_rc: tuple[int, int], radius_m: float
) -> UnseenFloor:
    """Return how much floor is unseen at most, by a grid as in `nav_msgs/OccupancyGrid`.

    Its cells are 0 where they are free, 100 where they are occupied, and -1 where they are unknown.
    `robot_rc` is the row and column of the robot, and `radius_m` that of its body. Raises ValueError if the grid has no
    free cell within the body's radius of the robot, or for lengths that are none.
    """
    if not (cell_m > 0.0 and radius_m > 0.0 and np.isfinite(cell_m + radius_m)):
        raise ValueError(
            f"expected a cell and a body of positive size, found {cell_m:g} and {radius_m:g} m: correct them"
        )
    seen_m2, frontier_m = frontier_of(grid, cell_m, robot_rc, radius_m)
    told = UnseenFloor(0.0, seen_m2, frontier_m)
    share = calibration().share(np.array([told.reach]))
    return UnseenFloor(float(share[0]) * seen_m2, seen_m2, frontier_m)


def unseen_now(step: Step) -> UnseenFloor | None:
    """Return the same at a step of a run, within its fence; None where nobody keeps the floor."""
    floor = step.free_space
    if not floor.evidence.size:
        return None
    grid = np.where(floor.beyond | floor.occupied, 100, np.where(floor.evidence < 0, FREE, UNKNOWN)).astype(np.int8)
    row, column = floor.cells(step.pose_world[:2]).tolist()
    try:
        return unseen_floor(grid, floor.config.cell_m, (row, column), step.robot.radius_m)
    except ValueError:
        return None


def unseen_words(step: Step) -> str:
    """Return in words how much floor is unseen at most; nothing where that is not known."""
    floor = unseen_now(step)
    return "" if floor is None else f"95 %: < {floor.at_most_m2:.1f} m2 unseen"


def frontier_of(
    grid: Int8[np.ndarray, "h w"], cell_m: float, robot_rc: tuple[int, int], radius_m: float
) -> tuple[float, float]:
    """Return the area of free floor, m2, and the length of the border that the robot can drive to, m."""
    grid = np.pad(grid, 1, constant_values=UNKNOWN)
    row, column = robot_rc[0] + 1, robot_rc[1] + 1
    free, unknown = (grid >= FREE) & (grid < OCCUPIED_FROM), grid == UNKNOWN
    room_m = cell_m * distance_transform_edt(grid < OCCUPIED_FROM)
    here = np.zeros_like(free)
    rows, columns = np.ogrid[: free.shape[0], : free.shape[1]]
    here[np.hypot(rows - row, columns - column) * cell_m <= radius_m] = True
    if not (free & here).any():
        raise ValueError(f"expected a robot on free cells, found none about row {row - 1}, column {column - 1}")
    reached = _joined((free & (room_m > radius_m)) | (free & here), here)
    border = reached & binary_dilation(unknown)
    groups, _ = label(border, np.ones((3, 3)))
    sizes = np.bincount(groups.ravel())
    sizes[0] = 0
    return float(free.sum()) * cell_m**2, float(sizes[sizes >= LEAST_CELLS].sum()) * cell_m


def _joined(cells: Bool[np.ndarray, "h w"], here: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Return the cells that are connected with those here."""
    groups, _ = label(cells, np.ones((3, 3)))
    return np.isin(groups, np.setdiff1d(groups[cells & here], [0]))


@cache
def calibration() -> Bound:
    """Return the stored calibration."""
    return decode(files(__package__).joinpath(TABLE).read_bytes(), type=Bound)


def calibrated(reach: Float[np.ndarray, " n"], share: Float[np.ndarray, " n"], runs: int) -> Bound:
    """Return the conformal bound by the reaches and shares of some grids."""
    is_open = reach > 0.0
    return Bound(_quantile(share[~is_open]), _quantile(share[is_open] / np.sqrt(reach[is_open])), runs)


def _quantile(values: Float[np.ndarray, " n"]) -> float:
    """Return what the next value of their kind does not exceed with 95 %; infinite for fewer than 19."""
    rank = int(np.ceil(CONFIDENCE * (len(values) + 1)))
    return float(np.sort(values)[rank - 1]) if rank <= len(values) else np.inf
