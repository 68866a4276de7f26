"""The grid of free floor follows the map: against a grid drawn from the true places of the scans."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.floor.floor_memory import FloorMemory, FloorMemoryConfig
from chainslam.explore.floor.free_space import FreeSpace
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import compose, inverse, to_world, wrap
from chainslam.slam.robot import Odometry, Scan

FACES = np.array(
    [
        [[0.0, 0.0], [12.0, 0.0]],
        [[12.0, 0.0], [12.0, 2.0]],
        [[12.0, 2.0], [5.0, 2.0]],
        [[5.0, 2.0], [5.0, 6.0]],
        [[5.0, 6.0], [0.0, 6.0]],
        [[0.0, 6.0], [0.0, 0.0]],
    ]
)
"""A room with a corridor 7 m long leading out of it."""
SCENE_REST = FloorMemoryConfig().rest_steps


def scan_at(pose):
    finder = RangeFinder(FACES, LidarConfig())
    return Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, finder.config.range_max_m, 0.0)


def moved_scene(scene, motion):
    """Return the scene with its walls moved as one."""
    return replace(scene, faces=to_world(scene.faces, motion))


def drive(memory, scene, poses, motion):
    """Take in a scan at each true pose, in a map that has moved by `motion`."""
    for pose in poses:
        memory.see(moved_scene(scene, motion).walls(compose(motion, pose)), scan_at(pose))


@pytest.fixture
def scene(scene_of):
    return replace(scene_of(0), faces=FACES)


@pytest.fixture
def way():
    """Poses through the room, into the corridor, and back to the room, 0.3 m apart."""
    out = np.arange(1.0, 11.0, 0.3)
    there = np.column_stack([out, np.full(len(out), 1.0), np.zeros(len(out))])
    rest = np.column_stack([np.full(SCENE_REST, 2.0), np.linspace(1.5, 4.0, SCENE_REST), np.linspace(0, 3, SCENE_REST)])
    return there, rest


def agreement(grid, truth):
    """Return the share of the cells known to either that both know as free or both as occupied."""
    cells = np.argwhere(truth.evidence != 0)
    there = grid.cells(truth.points(cells))
    inside = grid.inside(there)
    found = np.zeros(len(cells))
    found[inside] = np.sign(grid.evidence[tuple(there[inside].T)])
    return float(np.mean(found == np.sign(truth.evidence[tuple(cells.T)])))


@pytest.mark.parametrize("motion", [(0.3, -0.2, 0.0), (0.0, 0.0, 0.1), (-1.0, 2.0, -0.3)])
def test_a_map_that_moves_as_one_takes_the_floor_along(scene, way, motion):
    """The robot drove in one frame, then everything turns and shifts; nothing but the walls tells of it."""
    motion, (there, rest) = np.array(motion), way
    memory = FloorMemory(FreeSpace())
    drive(memory, scene, there, np.zeros(3))
    drive(memory, scene, rest, motion)
    truth = FreeSpace()
    for pose in [*there, *rest]:
        truth.integrate(compose(motion, pose), scan_at(pose))
    assert agreement(memory.free_space, truth) > 0.95


def test_without_it_the_floor_stays_where_it_was(scene, way):
    """The check of the test above tells a grid that follows from one that does not."""
    motion, (there, rest) = np.array([0.0, 0.0, 0.1]), way
    memory = FloorMemory(FreeSpace(), FloorMemoryConfig(moved_m=np.inf))
    drive(memory, scene, there, np.zeros(3))
    drive(memory, scene, rest, motion)
    truth = FreeSpace()
    for pose in [*there, *rest]:
        truth.integrate(compose(motion, pose), scan_at(pose))
    assert agreement(memory.free_space, truth) < 0.9


def test_a_map_that_stays_leaves_the_grid_as_all_scans_drew_it(scene, way):
    memory, grid = FloorMemory(FreeSpace()), FreeSpace()
    for poses in (*way, *way):
        drive(memory, scene, poses, np.array([0.01, -0.01, 0.002]))
        for pose in poses:
            grid.integrate(compose(np.array([0.01, -0.01, 0.002]), pose), scan_at(pose))
    np.testing.assert_array_equal(memory.free_space.evidence, grid.evidence)


def test_in_a_corridor_the_scans_before_tell_how_far_along(scene):
    """Two parallel walls say nothing of the shift along them; the scan in the room, kept before, does."""
    corridor = np.column_stack([np.arange(6.5, 9.5, 0.3), np.full(10, 1.0), np.zeros(10)])
    room = np.array([[2.5, 1.0, 0.0]])
    parallel = FloorMemoryConfig(walls=2)
    memory, motion = FloorMemory(FreeSpace(), parallel), np.array([0.5, 0.0, 0.0])
    drive(memory, scene, room, np.zeros(3))
    drive(memory, scene, corridor, np.zeros(3))
    drive(memory, scene, np.repeat(corridor[-1:], SCENE_REST, axis=0), motion)
    kept = np.array([view.pose_world for view in memory._kept.values()])
    np.testing.assert_allclose(kept[:10], np.concatenate([room, corridor])[:10] + motion, atol=0.02)


def test_walls_that_are_gone_tell_nothing(scene, way):
    """A map that lost all its walls, or has none yet, moves no floor."""
    memory, grid = FloorMemory(FreeSpace()), FreeSpace()
    none = replace(scene, faces=np.zeros((0, 2, 2)))
    for poses, seen in zip(way, (scene, none), strict=True):
        for pose in poses:
            memory.see(seen.walls(pose), scan_at(pose))
            grid.integrate(pose, scan_at(pose))
    np.testing.assert_array_equal(memory.free_space.evidence, grid.evidence)


def test_headings_wrap(scene):
    """A map that turns over the cut at half a turn turns no farther than it does."""
    memory = FloorMemory(FreeSpace())
    pose = np.array([2.0, 2.0, np.pi - 0.01])
    drive(memory, scene, pose[None], np.zeros(3))
    drive(memory, scene, np.tile([3.0, 3.0, 0.0], (SCENE_REST, 1)), np.array([0.0, 0.0, 0.05]))
    kept = next(iter(memory._kept.values())).pose_world
    np.testing.assert_allclose(kept[2], wrap(np.pi + 0.04), atol=1e-3)


def test_the_floor_follows_at_once_where_robot_and_map_jump_together(scene, way):
    """In the twenty steps until the next look the robot stood in a wall of the old floor, and gave up all its ends."""
    memory, still = FloorMemory(FreeSpace()), Odometry(np.zeros(3), np.zeros((3, 3)))
    poses, jump = way[0][:8], np.array([0.3, 0.9, 0.0])
    for before, pose in zip(poses, [*poses[1:], poses[-1]], strict=True):
        memory.see(scene.walls(before), scan_at(before))
        memory.move(replace(still, motion=compose(inverse(before), pose)))
    drawn = np.argwhere(memory.free_space.driven((slice(None), slice(None))))
    memory.see(moved_scene(scene, jump).walls(compose(jump, poses[-1])), scan_at(poses[-1]))
    follows = np.argwhere(memory.free_space.driven((slice(None), slice(None))))
    np.testing.assert_allclose(0.05 * (follows.mean(axis=0) - drawn.mean(axis=0))[::-1], jump[:2], atol=0.07)


def test_a_grid_that_is_drawn_anew_in_pieces_comes_to_be_that_drawn_at_once(scene, way):
    """The old one stays in use for some steps; scans and ways of these steps are in the new one, too."""
    there, rest = way
    motion = np.array([0.3, -0.2, 0.05])
    at_once, slowly = FloorMemory(FreeSpace()), FloorMemory(FreeSpace(), FloorMemoryConfig(redrawn=3))
    for memory in (at_once, slowly):
        drive(memory, scene, there, np.zeros(3))
        drive(memory, scene, rest[:1], motion)
    before = np.count_nonzero(slowly.free_space.evidence)
    assert not np.array_equal(at_once.free_space.evidence, slowly.free_space.evidence)
    pieces = len(there) // 3 + 1
    for k, pose in enumerate(rest[1 : pieces + 1]):
        for memory in (at_once, slowly):
            drive(memory, scene, [pose], motion)
        if k < pieces // 2:
            assert np.count_nonzero(slowly.free_space.evidence) >= before, "the old grid is in use"
    one, other = at_once.free_space, slowly.free_space
    cells = np.argwhere(one.evidence != 0)
    assert len(cells) > 1000
    same = tuple(other.cells(one.points(cells)).T)
    np.testing.assert_array_equal(other.evidence[same], one.evidence[tuple(cells.T)])
    np.testing.assert_allclose(slowly.way_world(), at_once.way_world())
    whole = (slice(None), slice(None))
    assert other.driven(whole).sum() == one.driven(whole).sum()
    np.testing.assert_allclose(other.clearance()[same], one.clearance()[tuple(cells.T)])
