"""Free-space coverage: how much of the visible floor the range finder has seen, and how soon, at true poses."""

from functools import lru_cache

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int
from shapely.geometry.base import BaseGeometry

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World
from chainslam.slam.estimation.mounting import scanner_poses
from chainslam.slam.geometry.poses import wrap_positive
from chainslam.slam.robot import Scan

CELL_M = 0.05
LOOKOUT_M = 0.25
LOOKOUT_BEAMS = 720
PERCENTS = (90, 99)
"""Shares of the visible floor whose time and path are scores: those of Explore-Bench (Xu et al., ICRA 2022)."""
SOON = tuple(f"swept_{percent}_{what}" for percent in PERCENTS for what in ("s", "m", "steps"))
"""The keys of `soon`."""


class Floor:
    """The cells of a building's free floor, and which of them were seen."""

    def __init__(self, free: BaseGeometry) -> None:
        self._x, self._y, self.free = _free_cells(free)
        self.seen: Bool[np.ndarray, "h w"] = np.zeros_like(self.free)

    def cover(self, region: shapely.Geometry) -> None:
        """Mark the cells inside a region as seen."""
        grid_x, grid_y = np.meshgrid(self._x, self._y)
        shapely.prepare(region)
        self.seen |= self.free & shapely.contains_xy(region, grid_x, grid_y)

    def is_seen_around(self, pose_world: Float[np.ndarray, "3"], range_max_m: float) -> bool:
        """Return whether every cell in view of this pose is marked already."""
        return not len(self._unseen_around(pose_world, range_max_m)[0])

    def _unseen_around(
        self, pose_world: Float[np.ndarray, "3"], range_max_m: float
    ) -> tuple[Int[np.ndarray, " c"], Int[np.ndarray, " c"]]:
        """Return rows and columns of the free cells near a pose, in a square, that were not seen yet."""
        columns = slice(*np.searchsorted(self._x, [pose_world[0] - range_max_m, pose_world[0] + range_max_m]))
        rows = slice(*np.searchsorted(self._y, [pose_world[1] - range_max_m, pose_world[1] + range_max_m]))
        row, column = np.nonzero(self.free[rows, columns] & ~self.seen[rows, columns])
        return row + rows.start, column + columns.start

    def look(
        self,
        pose_world: Float[np.ndarray, "3"],
        bearings_rad: Float[np.ndarray, " k"],
        ranges_m: Float[np.ndarray, " k"],
        range_max_m: float,
    ) -> tuple[Int[np.ndarray, " c"], Int[np.ndarray, " c"]]:
        """Mark the cells that lie before the return of the beam nearest to them; a missing return is free floor.

        One that was lost is not (`Scan.shown_m`). Returns rows and columns of the cells that were not seen before.
        """
        row, column = self._unseen_around(pose_world, range_max_m)
        dx, dy = self._x[column] - pose_world[0], self._y[row] - pose_world[1]
        step = (bearings_rad[-1] - bearings_rad[0]) / (len(bearings_rad) - 1)
        turn = wrap_positive(np.arctan2(dy, dx) - pose_world[2] - bearings_rad[0] + 0.5 * step)
        beam = np.floor(turn / step).astype(np.int64)
        reach = Scan(bearings_rad, ranges_m, 0.0, range_max_m, 0.0).shown_m
        # Beyond the last beam of less than a full turn nothing is seen.
        visible = (beam < len(reach)) & (np.hypot(dx, dy) <= reach[np.minimum(beam, len(reach) - 1)])
        self.seen[row[visible], column[visible]] = True
        return row[visible], column[visible]


@lru_cache(maxsize=4)
def _free_cells(
    free: BaseGeometry,
) -> tuple[Float[np.ndarray, " w"], Float[np.ndarray, " h"], Bool[np.ndarray, "h w"]]:
    """Return the middles of columns and rows, and which cells are free; not to be written to."""
    low = np.array(free.bounds[:2])
    count = np.ceil((np.array(free.bounds[2:]) - low) / CELL_M).astype(int)
    x, y = (low[axis] + (np.arange(count[axis]) + 0.5) * CELL_M for axis in (0, 1))
    shapely.prepare(free)
    is_free = np.asarray(shapely.contains_xy(free, *np.meshgrid(x, y)))
    is_free.flags.writeable = False
    return x, y, is_free


@lru_cache(maxsize=4)
def visible_floor(world: World, config: RobotConfig) -> Bool[np.ndarray, "h w"]:
    """Return the cells that the disc can cover or the scanner can see within range from a reachable position.

    Everything visible from the reachable region is also visible from its boundary, so only the boundary is sampled.
    """
    floor = Floor(world.floor)
    region = world.reachable(config.half_width_m)
    if region.is_empty:
        return floor.seen
    floor.cover(region.buffer(config.half_width_m))
    region = world.lookouts(config.half_width_m, config.true_scanner.off_m)
    finder = RangeFinder(world.faces, LidarConfig(LOOKOUT_BEAMS, range_max_m=config.lidar.range_max_m))
    for ring in (region.exterior, *region.interiors):
        places = shapely.get_coordinates(ring.segmentize(LOOKOUT_M))
        # Arcs of the boundary have many vertices; one place in every LOOKOUT_M is enough.
        way = np.append(0.0, np.cumsum(np.hypot(*np.diff(places, axis=0).T)))
        keep = np.append(True, np.diff(np.floor(way / LOOKOUT_M)) > 0)
        for x, y in places[keep]:
            pose = np.array([x, y, 0.0])
            if floor.is_seen_around(pose, config.lidar.range_max_m):
                continue
            floor.look(pose, finder.bearings_rad, finder.cast(pose)[0], config.lidar.range_max_m)
    return floor.seen


def swept(
    world: World,
    config: RobotConfig,
    poses_world: Float[np.ndarray, "s 3"],
    bearings_rad: Float[np.ndarray, " k"],
    ranges_m: Float[np.ndarray, "s k"],
) -> Float[np.ndarray, " s"]:
    """Return the share of the visible floor that scans at these true poses of the body have seen, up to each."""
    target = visible_floor(world, config)
    floor = Floor(world.floor)
    finder = RangeFinder(world.faces, config.lidar) if config.faults.dropout > 0.0 else None
    news = []
    for pose, ranges in zip(scanner_poses(poses_world, config.true_scanner), ranges_m, strict=True):
        if finder is not None:
            # A beam without a valid return shows nothing, however many of its neighbours are missing too.
            ranges = np.where(np.isposinf(ranges) & np.isfinite(finder.cast(pose)[0]), np.nan, ranges)
        new = floor.look(pose, bearings_rad, ranges, config.lidar.range_max_m)
        news.append(np.count_nonzero(target[new]))
    return np.cumsum(news) / max(int(np.count_nonzero(target)), 1)


def soon(
    shares: Float[np.ndarray, " s"], time_s: Float[np.ndarray, " s"], path_length_m: Float[np.ndarray, " s"]
) -> dict[str, float | int | None]:
    """Return time, s, path length, m, and number of scans until each of `PERCENTS` was seen; None if it never was."""
    found: dict[str, float | int | None] = dict.fromkeys(SOON)
    for percent in PERCENTS:
        reached = np.flatnonzero(shares >= percent / 100)
        if len(reached):
            k = int(reached[0])
            values = (float(time_s[k]), float(path_length_m[k]), k + 1)
            found |= zip((key for key in SOON if f"_{percent}_" in key), values, strict=True)
    return found
