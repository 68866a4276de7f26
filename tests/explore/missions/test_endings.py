"""How missions end: what a room seen at a glance, and ends behind a slit, leave behind."""

import numpy as np
import pytest
import shapely

from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import explore_mission
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper


def explored(free, start, seed=1, errorless=True):
    world = World("drawn", shapely.orient_polygons(free), np.array(start), {})
    robot = SimulatedRobot(world, seed, errorless=errorless)
    backend = BACKENDS["full-ekf"].make(world.start.copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    steps = limited(explore_mission(robot, Mapper(backend), STRATEGIES["nearest-robot"].make()), Limits(steps=1500))
    *_, last = steps
    return last, robot


@pytest.mark.parametrize("size", [1.5, 4.0])
def test_a_room_that_is_seen_at_a_glance_is_mapped_before_the_mission_ends(size):
    last, _ = explored(shapely.box(0, 0, size, size), (0.4 * size, 0.35 * size, 0.1))
    assert last.ended == "complete"
    assert [chain.is_closed for chain in last.chains] == [True]
    assert len(last.chains[0].walls) == 4


@pytest.mark.parametrize("slit", [1.5, 1.7, 2.5])
def test_ends_behind_a_slit_too_narrow_for_the_robot_are_remembered_with_their_reasons(slit):
    """A wall divides the room; through the slit of 0.25 m, opposite, the robot sees the other half."""
    divide = shapely.union(shapely.box(2.4, 0.0, 2.5, slit), shapely.box(2.4, slit + 0.25, 2.5, 4.0))
    last, robot = explored(shapely.box(0, 0, 4, 4).difference(divide), (0.8, slit, 0.0))
    assert last.ended == "complete"
    assert robot.record.collisions == 0
    ends = {(end.wall, end.side) for chain in last.chains for end in chain.open_ends}
    assert ends
    assert {(aside.wall, aside.side) for aside in last.set_aside} == ends
    assert all(aside.reason for aside in last.set_aside)
    assert last.pose_world[0] < 2.4


@pytest.mark.parametrize("degrees", [6.0, 8.0, 10.0])
def test_a_wall_that_turns_by_a_few_degrees_is_two_walls_though_it_looks_straight_from_afar(degrees):
    bend = 0.7 * np.tan(np.deg2rad(degrees))
    room = shapely.Polygon([(0, 0), (4.5, 0), (4.5, 4.2 - bend), (3.8, 4.2), (0, 4.2)])
    last, _ = explored(room, (3.0, 0.5, 0.3))
    assert [chain.is_closed for chain in last.chains] == [True]
    assert len(last.chains[0].walls) == 5


@pytest.mark.parametrize("degrees", [6.0, 11.0])
def test_with_noise_the_sides_of_bends_join(degrees):
    """Walls that turn every metre: each was mapped past the bend, and looked at again and again."""
    across = np.arange(0.0, 5.1, 1.0)
    below = np.column_stack([across, np.tan(np.deg2rad(0.5 * degrees)) * (np.arange(6) % 2)])
    room = shapely.Polygon(np.concatenate([below, [5.0, 3.5] - below]))
    for seed in range(8):
        last, robot = explored(room, (2.0, 1.5, 0.3), seed, errorless=False)
        assert [chain.is_closed for chain in last.chains] == [True]
        assert len(last.chains[0].walls) == 12
        assert len(robot.record.poses_world) < 350


@pytest.mark.parametrize("start_x", [0.4, 0.6, 0.8])
def test_a_stub_beside_a_wall_is_looked_at_from_both_sides(start_x):
    """Straight past its end stands a wall, so that the robot can look at its far side only from farther off."""
    room = shapely.box(0, 0, 4, 3).difference(shapely.box(2.0, 0.0, 2.2, 0.2))
    last, _ = explored(room, (start_x, 0.6, 0.3))
    assert [chain.is_closed for chain in last.chains] == [True]
    assert len(last.chains[0].walls) == 8
