"""What the scans have seen free and what they have hit, on a grid at the estimated poses."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int
from msgspec import Meta

from chainslam.slam.geometry.poses import compose
from chainslam.slam.geometry.quantities import Count, Distance, Place, Size
from chainslam.slam.robot import RobotSpec, Scan, of_robot

from .kernels import Box, squared_distances, take_in

NO_CELLS = np.zeros((0, 0), dtype=bool)
_FARTHEST_M = 1e9
"""Cells farther from the origin are not counted any more."""


@dataclass(frozen=True)
class FreeSpaceConfig:
    """The occupancy grid of the floor."""

    robot: RobotSpec = of_robot()
    cell_m: Size = 0.05
    """Cell size."""
    hit: Count = 3
    """Evidence that a hit adds to a cell; a beam that passes through subtracts 1."""
    limit: Count = 6
    """Largest absolute evidence of a cell; the lower, the sooner a wrong cell is corrected."""
    fence: Annotated[tuple[tuple[Place, Place], ...], Meta(min_length=3)] | None = None
    """Corners of a polygon in the world frame that the robot stays within; what lies beyond is not explored."""
    cells_max: Count = 100_000_000
    """Largest number of cells; the default allows 500 m by 500 m, which take 0.6 GB."""
    clearance_beyond_m: Distance = 0.8
    """Clearances are exact up to the robot's radius plus this distance, and bounded from below beyond it."""

    @property
    def body_m(self) -> float:
        """Floor this near to the robot is free: it stands there."""
        return self.robot.inner_m

    @property
    def clearance_limit_m(self) -> float:
        """Clearances are exact up to here."""
        return self.robot.beyond(self.clearance_beyond_m)


class FloorTooLargeError(ValueError):
    """The robot believes to be where no grid can hold it and the floor that it has seen."""


class FreeSpace:
    """Evidence per cell: negative is free, positive is occupied, zero is unknown. Row is y, column is x."""

    def __init__(self, config: FreeSpaceConfig = FreeSpaceConfig()) -> None:
        self.config = config
        self._evidence = np.zeros((0, 0), dtype=np.int8)
        self._clearance = np.zeros((0, 0), dtype=np.float32)
        self._touched = np.zeros((0, 0), dtype=bool)
        self._beyond = np.zeros((0, 0), dtype=bool)
        self._fence = None if config.fence is None else shapely.Polygon(config.fence)
        self._first = np.zeros(2, dtype=np.int64)
        self._dirty: Box | None = None
        self.range_m = np.inf
        """Maximum range of the last scan."""

    def note_touched(self, place_world: Float[np.ndarray, "2"]) -> None:
        """Remember that the body touched something at a place: an obstacle, whatever beams say of it."""
        cells = self.cells(place_world[None])
        for row, column in cells[self.inside(cells)].tolist():
            self._touched[row, column] = True
            self._mark(row, row + 1, column, column + 1)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the grid."""
        return self._evidence.shape[0], self._evidence.shape[1]

    @property
    def evidence(self) -> Int[np.ndarray, "h w"]:
        """The grid itself, to be read only: negative is free, positive is occupied, zero is unknown."""
        return self._evidence

    @property
    def occupied(self) -> Bool[np.ndarray, "h w"]:
        """Which cells hold something: a beam ended there, or the body touched it."""
        return (self._evidence > 0) | self._touched

    def is_free(self, box: tuple[slice, slice]) -> Bool[np.ndarray, "h w"]:
        """Return which cells of a part of the grid were seen free."""
        return self._evidence[box] < 0

    @property
    def beyond(self) -> Bool[np.ndarray, "h w"]:
        """Which cells lie beyond the fence, to be read only; none without one."""
        return self._beyond

    def is_within(self, points_world: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Return which points lie within the fence; all without one."""
        if self._fence is None:
            return np.ones(len(points_world), dtype=bool)
        return np.asarray(shapely.contains_xy(self._fence, *points_world.T))

    @property
    def origin_world(self) -> Float[np.ndarray, "2"]:
        """The lower left corner of the grid, m."""
        return self._first * self.config.cell_m

    def cells(self, points_world: Float[np.ndarray, "*n 2"]) -> Int[np.ndarray, "*n 2"]:
        """Return (row, column) of points; cells outside the grid have indices outside it."""
        index = np.floor(points_world / self.config.cell_m).astype(np.int64) - self._first
        return index[..., ::-1]

    def points(self, cells: Int[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """Return the centres of cells (row, column), world frame, m."""
        return (cells[..., ::-1] + self._first + 0.5) * self.config.cell_m

    def inside(self, cells: Int[np.ndarray, "*n 2"]) -> Bool[np.ndarray, "*n"]:
        """Return which cells lie on the grid."""
        within = (cells >= 0) & (cells < self._evidence.shape)
        return within[..., 0] & within[..., 1]

    def unknown_at(self, points_world: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Return which points lie on floor that was never seen."""
        cells = self.cells(points_world)
        on_grid = self.inside(cells)
        unknown = np.ones(len(cells), dtype=bool)
        unknown[on_grid] = self._evidence[tuple(cells[on_grid].T)] == 0
        return unknown

    def clearance(self) -> Float[np.ndarray, "h w"]:
        """Return the distance from each cell to the nearest occupied one, m, up to the configured limit."""
        if self._dirty is not None:
            limit, cell = self.config.clearance_limit_m, self.config.cell_m
            reach = int(np.ceil(limit / cell))
            inner, outer = (_grown(self._dirty, k * (reach + 1), self._evidence.shape) for k in (1, 2))
            occupied = (self._evidence[_slices(outer)] > 0) | self._touched[_slices(outer)]
            metres = np.minimum(cell * np.sqrt(np.arange((reach + 1) ** 2 + 1)), limit).astype(np.float32)
            self._clearance[_slices(inner)] = metres[squared_distances(occupied, reach)][_slices(inner, outer)]
            self._dirty = None
        return self._clearance

    def clear(self) -> None:
        """Forget every scan and touch."""
        self._lay(self.shape)

    def integrate(self, pose_world: Float[np.ndarray, "3"], scan: Scan) -> None:
        """Take in one scan at an estimated pose of the body; raises FloorTooLargeError for one too far from others."""
        cell, scanner = self.config.cell_m, self.config.robot.scanner
        body_world = pose_world[:2]
        if not scanner.is_at_axle:
            pose_world = compose(pose_world, scanner.pose_robot)
        self.range_m = scan.range_max_m
        # With this much to spare, no cell that is added later lies near enough to an old hit to lack clearance.
        self._reserve(pose_world[:2], scan.range_max_m + self.config.clearance_limit_m + 2 * cell)
        # Two beams and the arc between them: it stands out beyond the line from tip to tip.
        beyond_m = scan.range_max_m * (1.0 - math.cos(scan.bearings_rad[1] - scan.bearings_rad[0]))
        r0, r1, c0, c1 = take_in(
            self._evidence,
            self._beyond if self._fence is not None else NO_CELLS,
            self._first,
            pose_world,
            body_world,
            scan.bearings_rad,
            scan.shown_m,
            np.isfinite(scan.ranges_m),
            scan.is_full_turn,
            cell,
            max(beyond_m, self.config.body_m + scanner.off_m),
            self.config.body_m,
            self.config.hit,
            self.config.limit,
        )
        if r0 < r1:
            self._mark(r0, r1, c0, c1)

    def _reserve(self, centre_world: Float[np.ndarray, "2"], reach_m: float) -> None:
        """Grow the grid, with room to spare, until it holds everything within reach."""
        reach = math.ceil(reach_m / self.config.cell_m) + 1
        x_m, y_m = centre_world.tolist()
        if not (abs(x_m) < _FARTHEST_M and abs(y_m) < _FARTHEST_M):
            raise self._too_large(centre_world)
        x, y = math.floor(x_m / self.config.cell_m), math.floor(y_m / self.config.cell_m)
        (column, row), (rows, columns) = self._first.tolist(), self.shape
        if column + reach <= x < column + columns - reach and row + reach <= y < row + rows - reach:
            return
        at = np.array([x, y])
        low, high = at - reach, at + reach + 1
        old_first, old_end = self._first, self._first + self._evidence.shape[::-1]
        if self._evidence.size == 0:
            old_first = old_end = at
        spare = reach
        first = np.where(low < old_first, low - spare, old_first)
        end = np.where(high > old_end, high + spare, old_end)
        shape = tuple((end - first)[::-1].tolist())
        if shape[0] * shape[1] > self.config.cells_max:
            raise self._too_large(centre_world)
        old = self._evidence, self._touched, self._clearance
        c, r = (self._first - first).tolist()
        self._first = first
        if old[0].size and self._dirty is not None:
            r0, r1, c0, c1 = self._dirty
            self._dirty = r0 + r, r1 + r, c0 + c, c1 + c
        self._lay(shape)
        place = (slice(r, r + old[0].shape[0]), slice(c, c + old[0].shape[1]))
        self._evidence[place], self._touched[place], self._clearance[place] = old

    def _lay(self, shape: tuple[int, ...]) -> None:
        """Make a grid of which nothing is known but what lies beyond the fence."""
        self._evidence = np.zeros(shape, dtype=np.int8)
        self._touched, self._beyond = np.zeros((2, *shape), dtype=bool)
        self._clearance = np.full(shape, self.config.clearance_limit_m, dtype=np.float32)
        if self._fence is not None:
            columns, rows = (
                (self._first[k] + np.arange(n) + 0.5) * self.config.cell_m for k, n in enumerate(shape[::-1])
            )
            self._beyond = ~np.asarray(shapely.contains_xy(self._fence, *np.meshgrid(columns, rows)))
            self._evidence[self._beyond] = self.config.limit
            self._mark(0, shape[0], 0, shape[1])

    def _too_large(self, centre_world: Float[np.ndarray, "2"]) -> FloorTooLargeError:
        side_m = np.sqrt(self.config.cells_max) * self.config.cell_m
        x, y = centre_world
        return FloorTooLargeError(
            f"expected all poses within {side_m:.0f} m by {side_m:.0f} m, found the robot believed at"
            f" ({x:.4g}, {y:.4g}) m: its estimate is lost"
        )

    def _mark(self, r0: int, r1: int, c0: int, c1: int) -> None:
        """Remember where occupied cells changed since the clearances were computed."""
        old = self._dirty or (r0, r1, c0, c1)
        self._dirty = min(old[0], r0), max(old[1], r1), min(old[2], c0), max(old[3], c1)


def _grown(box: Box, pad: int, shape: tuple[int, ...]) -> Box:
    return max(box[0] - pad, 0), min(box[1] + pad, shape[0]), max(box[2] - pad, 0), min(box[3] + pad, shape[1])


def _slices(box: Box, within: Box = (0, 0, 0, 0)) -> tuple[slice, slice]:
    return slice(box[0] - within[0], box[1] - within[0]), slice(box[2] - within[2], box[3] - within[2])
