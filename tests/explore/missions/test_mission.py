"""Missions in small drawn buildings: they end, say why, touch nothing, and are the same every time."""

from functools import cache

import numpy as np
import pytest
import shapely

from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import explore_mission
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.evaluation.consistency import pose_errors
from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.mapper import Mapper

P0 = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2


def drawn(*walls, start=(0.7, 0.7, 0.3), size=4.0):
    """Return a square room in which these boxes stand."""
    solid = shapely.union_all([shapely.box(*wall) for wall in walls])
    free = shapely.orient_polygons(shapely.box(0, 0, size, size).difference(solid))
    parts = shapely.get_parts(free)
    inside = parts[[bool(part.contains(shapely.Point(start[:2]))) for part in parts]]
    return World("drawn", shapely.orient_polygons(inside[0]), np.array(start), {})


BLOCK = drawn((1.7, 1.6, 2.4, 2.3))


LONG = 1500


def mission(world, seed=1, errorless=True, backend="full-ekf", max_steps=LONG, strategy="nearest-robot"):
    robot = SimulatedRobot(world, seed, errorless)
    estimator = BACKENDS[backend].make(world.start.copy(), P0.copy())
    steps = explore_mission(robot, Mapper(estimator), STRATEGIES[strategy].make())
    return list(limited(steps, Limits(steps=max_steps))), robot


@cache
def around_a_block():
    return mission(BLOCK)


def test_a_room_with_a_block_is_explored_until_every_chain_is_closed():
    steps, robot = around_a_block()
    last = steps[-1]
    assert last.ended == "complete"
    assert last.decision.words
    assert last.decision.command is None
    assert last.set_aside == ()
    assert robot.record.collisions == 0
    assert [chain.is_closed for chain in last.chains] == [True, True]
    assert sorted(len(chain.walls) for chain in last.chains) == [4, 4]
    assert len(last.map) == 8


def test_without_errors_the_map_is_the_drawing_and_the_pose_the_truth():
    steps, robot = around_a_block()
    last = steps[-1]
    for ends in last.map.ends_world:
        gap = np.minimum.reduce([np.abs(ends - face).max(axis=(0, 1)) for face in BLOCK.faces])
        assert gap < 0.02
    estimated = np.array([step.pose_world for step in steps])
    error = pose_errors(estimated, np.array(robot.record.poses_world))
    assert np.abs(error).max() < 1e-3


def test_steps_count_on_and_only_the_last_one_ends():
    steps, _ = around_a_block()
    assert [step.index for step in steps] == list(range(len(steps)))
    assert all(step.ended is None and step.decision.command is not None for step in steps[:-1])
    assert np.all(np.diff([step.time_s for step in steps]) > 0)
    assert np.all(np.diff([step.path_length_m for step in steps]) >= 0)
    assert all(step.decision.words for step in steps)
    assert all(abs(step.decision.command.forward_m) <= 0.15 + 1e-12 for step in steps[:-1])


def test_every_goal_was_an_open_end_of_the_map_at_its_step():
    steps, _ = around_a_block()
    goals = [step for step in steps if step.decision.goal is not None and step.decision.goal.kind == "open-end"]
    assert goals
    for step in goals:
        ends = {(end.wall, end.side) for chain in step.chains for end in chain.open_ends}
        assert (step.decision.goal.wall, step.decision.goal.side) in ends


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_the_same_seed_gives_the_same_steps_bit_for_bit(backend):
    one, other = (mission(BLOCK, 3, errorless=False, backend=backend, max_steps=40)[0] for _ in range(2))
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        assert a.pose_world.tobytes() == b.pose_world.tobytes()
        assert a.map.belief.pose_cov.tobytes() == b.map.belief.pose_cov.tobytes()
        assert a.map.belief.means.tobytes() == b.map.belief.means.tobytes()
        assert a.map.extents.tobytes() == b.map.extents.tobytes()
        assert a.decision.command == b.decision.command
        assert [chain.walls for chain in a.chains] == [chain.walls for chain in b.chains]


def test_another_seed_gives_other_noise():
    one, other = (mission(BLOCK, seed, errorless=False, max_steps=5)[0] for seed in (1, 2))
    assert one[0].scan.ranges_m.tobytes() != other[0].scan.ranges_m.tobytes()


@pytest.mark.parametrize("limit", [1, 7])
def test_a_mission_that_takes_longer_than_its_limit_is_stopped(limit):
    steps, _ = mission(BLOCK, max_steps=limit)
    assert len(steps) == limit
    assert steps[-1].ended == "stopped"
    assert str(limit) in steps[-1].decision.words


@pytest.mark.parametrize("seed", range(1, 6))
def test_with_noise_the_room_is_explored_without_touching_anything(seed):
    steps, robot = mission(BLOCK, seed, errorless=False, max_steps=600)
    assert steps[-1].ended == "complete"
    assert robot.record.collisions == 0
    poses = np.array(robot.record.poses_world)
    assert distance_to_segments(poses[:, :2], BLOCK.faces).min() >= 0.2


def test_the_visibility_graph_and_the_map_speak_of_the_same_walls():
    steps, _ = around_a_block()
    last = steps[-1]
    assert set(last.graph) == set(last.map.ids[~last.map.tentative].tolist())
