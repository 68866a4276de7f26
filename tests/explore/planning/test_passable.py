"""Gaps between two rooms: which of them a path leads through, and at what price."""

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Planner
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.robot import Scan

CONFIG = PathConfig()
START, GOAL = np.array([1.0, 1.5]), np.array([3.0, 1.5])


def through(width_m):
    """Return the path between two rooms through a gap that is as wide, None where there is none."""
    low, high = 1.525 - 0.5 * width_m, 1.525 + 0.5 * width_m
    walls = shapely.union_all([shapely.box(1.95, 0, 2.1, low), shapely.box(1.95, high, 2.1, 3)])
    (room,) = shapely.get_parts(shapely.orient_polygons(shapely.box(0, 0, 4, 3).difference(walls)))
    ring = shapely.get_coordinates(room.exterior)
    finder, grid = RangeFinder(np.stack([ring[:-1], ring[1:]], axis=1), LidarConfig()), FreeSpace()
    for x in (0.6, 1.2, 1.6, 2.4, 2.8, 3.4):
        for y in (0.5, 1.2, 1.52, 1.85, 2.5):
            pose = np.array([x, y, 0.0])
            grid.integrate(pose, Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0))
    return Planner(grid, START, CONFIG).to(GOAL[None])


@pytest.mark.parametrize("spare_m", [0.02, 0.04])
def test_a_gap_hardly_wider_than_the_body_is_passed_at_a_price(spare_m):
    narrow, wide = through(2.0 * CONFIG.robot.half_width_m + spare_m), through(1.2)
    assert narrow is not None
    assert narrow.cost > wide.cost + 0.1 * CONFIG.squeeze_cost


def test_no_path_leads_through_a_gap_narrower_than_the_body():
    assert through(2.0 * CONFIG.robot.half_width_m - 0.1) is None
