"""The grid of free floor as all scans drew it, and as the last ones draw it anew."""

import numpy as np

from chainslam.explore.floor.floor_memory import FloorMemory, FloorMemoryConfig
from chainslam.explore.floor.free_space import FreeSpace
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.robot import Odometry, RobotSpec, Scan

FACES = np.array(
    [[[0.0, 0.0], [9.0, 0.0]], [[9.0, 0.0], [9.0, 3.0]], [[9.0, 3.0], [0.0, 3.0]], [[0.0, 3.0], [0.0, 0.0]]]
) + np.array([0.02, 0.03])  # off the borders of cells
WAY = np.column_stack([np.arange(1.0, 8.0, 0.3), np.full(24, 1.4), np.linspace(-0.5, 0.5, 24)])
"""Poses along a hall."""


def scan_at(pose):
    finder = RangeFinder(FACES, LidarConfig())
    return Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, finder.config.range_max_m, 0.0)


def driven(last_m=15.0):
    """Drive along the hall; the odometry tells the truth."""
    memory = FloorMemory(FreeSpace(), FloorMemoryConfig(last_m=last_m))
    for pose, after in zip(WAY, [*WAY[1:], None], strict=True):
        memory.see(pose, scan_at(pose))
        if after is not None:
            memory.move(Odometry(compose(inverse(pose), after), np.zeros((3, 3))))
    return memory


def drawn(poses, motion=(0.0, 0.0, 0.0)):
    grid = FreeSpace()
    for pose in poses:
        grid.integrate(compose(np.asarray(motion), pose), scan_at(pose))
    return grid


def assert_same(one, other):
    cells = np.argwhere(other.evidence != 0)
    np.testing.assert_array_equal(one.evidence[tuple(one.cells(other.points(cells)).T)], other.evidence[tuple(cells.T)])
    assert np.count_nonzero(one.evidence) == len(cells)


def test_every_scan_is_drawn_where_the_map_believes_it_was_taken():
    memory = driven()
    assert_same(memory.free_space, drawn(WAY))
    np.testing.assert_array_equal(memory.way_world(), WAY[:, :2])
    back = memory.last_way_world(WAY[-1], 1.0)
    np.testing.assert_allclose(back, WAY[: -len(back) - 1 : -1, :2], atol=1e-9)


def test_a_grid_begun_anew_has_the_last_scans_only_seen_from_where_the_robot_is_now():
    last = 8
    memory, motion = driven(last * RobotSpec().step_m), np.array([0.3, -0.2, 0.4])
    memory.begin_anew(compose(motion, WAY[-1]))
    assert_same(memory.free_space, drawn(WAY[-last:], motion))
    assert len(memory.way_world()) == last
