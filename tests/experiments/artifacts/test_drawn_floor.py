"""The ROS map of a recorded drive: what its scans show of the floor, and what they leave open."""

from unittest.mock import Mock

import numpy as np
import pytest

from chainslam.experiments.artifacts.maps.drawn_floor import drawn_floor
from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import Recording
from chainslam.slam.robot import RobotSpec, Scan
from chainslam.viz.timeline.drawn_step import Keeper

BEARINGS = np.deg2rad(np.arange(-90.0, 91.0))


def recorded(ranges):
    n = len(ranges)
    return Recording(np.zeros(n), BEARINGS, ranges, np.full(181, 0.02), 80.0, np.zeros((n, 3)), np.zeros((n, 3, 3)))


def test_what_a_real_scanner_does_not_see_again_is_neither_floor_nor_wall():
    """Glass and black walls return nothing; what lies far away is free up to where it is near."""
    ranges = np.where(BEARINGS > 0.2, np.inf, np.where(BEARINGS < -0.2, 2.0, 30.0))
    floor = drawn_floor(recorded(ranges[None]), np.zeros((1, 3)), FreeSpaceConfig())
    there = floor.evidence[tuple(floor.cells(np.array([[10.0, 0.0], [20.0, 0.0], [0.3, 5.0], [0.1, -1.5]])).T)]
    assert (there[0] < 0, there[1], there[2], there[3] < 0) == (True, 0, 0, True)


def test_a_log_of_poses_that_no_grid_holds_has_no_ros_map():
    poses = np.array([[0.0, 0.0, 0.0], [1e5, 0.0, 0.0]])
    assert drawn_floor(recorded(np.full((2, 181), 2.0)), poses, FreeSpaceConfig()).evidence.size == 0


@pytest.mark.parametrize(("reach_m", "floor"), [(80.0, False), (8.0, True)])
def test_a_timeline_draws_floor_where_nothing_came_back_for_short_scanners_alone(reach_m, floor):
    """A simulated scanner of 8 m gets nothing where there is nothing; one of 80 m gets nothing from glass."""
    pose = np.zeros(3)
    scan = Scan(BEARINGS, np.full(181, np.inf), 0.02, reach_m, 0.0)
    step = Mock(Step, free_space=FreeSpace(), robot=RobotSpec(), index=0, pose_world=pose, scan=scan)
    swept = Keeper()._swept(step, last=True)
    assert (swept is not None and swept.free.size > 1000) == floor
