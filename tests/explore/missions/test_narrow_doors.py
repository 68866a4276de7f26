"""Doors hardly wider than the body: passed where it fits, given up for good where it does not, never touched."""

import numpy as np
import pytest
import shapely
from shapely import affinity

from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import explore_mission
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper


def explored(door_m, turn_deg, errorless):
    """Two rooms of 2.4 m with a door between them; return the last step, the robot and how far right it came, m."""
    divide = shapely.union(shapely.box(2.4, 0.0, 2.5, 1.23), shapely.box(2.4, 1.23 + door_m, 2.5, 4.0))
    free = shapely.box(0, 0, 5, 4).difference(divide)
    start = affinity.rotate(shapely.Point(0.5, 0.5), turn_deg, origin=(0, 0))
    free = affinity.rotate(free, turn_deg, origin=(0, 0))
    world = World("drawn", shapely.orient_polygons(free), np.array([start.x, start.y, 0.0]), {})
    robot = SimulatedRobot(world, 1, errorless=errorless)
    backend = BACKENDS["full-ekf"].make(world.start.copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    right = np.array([np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))])
    *_, last = limited(explore_mission(robot, Mapper(backend), STRATEGIES["nearest-robot"].make()), Limits(steps=1000))
    return last, robot, max(float(pose[:2] @ right) for pose in robot.record.poses_world)


@pytest.mark.parametrize(
    ("door_m", "turn_deg", "errorless"),
    [
        *((0.45, 0, True), (0.45, 13, False), (0.45, 25.7, True), (0.45, 37, True), (0.45, 72.7, False)),
        *((0.442, 0, True), (0.442, 22, True), (0.442, 37, True), (0.434, 0, True)),
    ],
)
def test_a_door_that_leaves_two_centimetres_on_each_side_is_passed(door_m, turn_deg, errorless):
    last, robot, farthest = explored(door_m, turn_deg, errorless)
    assert last.ended is not None
    assert robot.record.collisions == 0
    assert farthest > 2.7


@pytest.mark.parametrize(("door_m", "errorless"), [(0.38, True), (0.41, True), (0.43, False)])
def test_a_door_too_narrow_to_be_safe_ends_the_mission_without_a_touch(door_m, errorless):
    last, robot, _ = explored(door_m, 0, errorless)
    assert robot.record.collisions == 0
    assert last.index < 999, "the robot never gave up"
