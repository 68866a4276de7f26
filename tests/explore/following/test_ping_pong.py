"""Ping-pong along a wall, and what is tried before an end is given up."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.following.ping_pong import WallErrand
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.goals.explorer import Explorer
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.strategies.nearest_robot import NearestRobot
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import arc, compose
from chainslam.slam.map.chains import HEAD, TAIL
from chainslam.slam.robot import Scan

pytestmark = pytest.mark.usefixtures("_unchecked")


def walk(scene, wall, side, pose, most=400):
    """Let the robot follow one wall without errors, and return its poses."""
    finder, errand, poses = RangeFinder(scene.faces, LidarConfig()), WallErrand(wall, side, FollowingConfig()), [pose]
    for _ in range(most):
        scan = Scan(finder.bearings_rad, finder.cast(poses[-1])[0], 0.01, 4.0, 0.0)
        command = errand.command(Surroundings(scene.walls(poses[-1]), scene.grid, scan))
        if command is None:
            return np.array(poses), errand
        poses.append(compose(poses[-1], arc(command.forward_m, command.turn_rad)))
    raise AssertionError("the walk has no end")


def first_near(poses, place, reach):
    near = np.flatnonzero(np.hypot(*(poses[:, :2] - place).T) < reach)
    return near[0] if len(near) else None


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("side", [None, TAIL, HEAD])
def test_a_wall_is_followed_to_one_end_and_then_to_the_other_at_its_distance(scene_of, seed, side):
    """The longest wall, from a random place: the ends that can be reached are visited in the order asked for."""
    scene = scene_of(seed)
    wall = int(np.argmax(np.hypot(*(scene.faces[:, 1] - scene.faces[:, 0]).T)))
    pose = np.append(scene.places[7], 1.0)
    poses, _ = walk(scene, wall, side, pose)
    assert shapely.distance(shapely.MultiPoint(poses[:, :2]), scene.room.boundary) > 0.2
    visited = [first_near(poses, scene.faces[wall, k], 0.75) for k in (TAIL, HEAD)]
    assert any(v is not None for v in visited)
    first = side
    if side is None:
        first = int(np.argmin(np.hypot(*(scene.faces[wall] - pose[:2]).T)))
    if None not in visited and np.hypot(*(scene.faces[wall, 1 - first] - pose[:2])) > 0.75:
        last = poses[-1, :2] - scene.faces[wall, 1 - first]
        assert np.hypot(*last) < 1.3
        assert visited[first] < len(poses) - 1


@pytest.mark.parametrize("side", [TAIL, HEAD])
def test_along_a_free_wall_the_robot_keeps_its_distance(scene_of, look, side):
    room = shapely.box(0, 0, 6, 3)
    corners = np.array([[0, 0], [6, 0], [6, 3], [0, 3]], dtype=float)
    faces = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    scene = replace(scene_of(0), room=room, faces=faces, grid=FreeSpace())
    look(scene, np.array([[1.0, 1.5], [3.0, 1.5], [5.0, 1.5]]))
    poses, _ = walk(scene, 0, side, np.array([3.0, 2.0, 0.0]))
    ends = [first_near(poses, scene.faces[0, k], 0.75) for k in (side, 1 - side)]
    assert 0 < ends[0] < ends[1]
    gaps = poses[ends[0] : ends[1], 1]
    assert gaps.min() > 0.25
    assert gaps.max() < 0.75
    assert np.median(gaps) == pytest.approx(FollowingConfig().viewpoints.standoff_m, abs=0.1)


def test_a_wall_that_is_gone_is_not_followed(scene_of):
    scene = scene_of(0)
    poses, errand = walk(scene, 999, None, np.append(scene.places[0], 0.0))
    assert len(poses) == 1
    assert "999" in errand.trouble


def test_an_end_that_nothing_could_be_seen_of_is_tried_again_when_the_floor_there_is_known(scene_of, look):
    scene = scene_of(0, 0)
    gaps = np.hypot(*np.moveaxis(scene.faces[None] - scene.places[:, None, None], -1, 0)).min(axis=2)
    row, far = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    assert gaps[row, far] > ExplorerConfig().following.viewpoints.far_m + 0.7
    here, far = scene.places[row], int(far)
    look(scene, here[None], 0.6)
    pose = np.append(here, 0.0)
    situation = scene.situation(pose, [(far,)])
    explorer = Explorer(NearestRobot(), here, ExplorerConfig())
    decision = explorer.decide(situation.around, situation.chains, nx.DiGraph())
    assert decision.given_up.keys == {(far, TAIL), (far, HEAD)}
    assert all(aside.reason for aside in decision.given_up.ends)
    assert decision.goal is not None
    assert decision.goal.kind == "unseen"
    look(scene, scene.places)
    decision = explorer.decide(situation.around, situation.chains, nx.DiGraph())
    assert decision.command is not None
    assert decision.goal.kind == "open-end"
    assert decision.goal.wall == far
