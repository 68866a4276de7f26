"""Whatever the map says, a command keeps the disc clear of every return of the scan."""

from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.explore.floor.accumulated_returns import SCANS, AccumulatedReturns, returns
from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.following.driving import Pilot, obstacles
from chainslam.explore.following.driving_config import DrivingConfig
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Field, Path, Planner
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import arc, compose
from chainslam.slam.robot import Odometry, RobotSpec, Scan

few = settings(max_examples=80, deadline=None, derandomize=True)
CONFIG = DrivingConfig()
AT_AXLE = CONFIG.robot.scanner
NOTHING = np.zeros((0, 2))
BEARINGS = -np.pi + np.arange(180) * np.deg2rad(2.0)


def scan_of(ranges):
    return Scan(BEARINGS, ranges, 0.01, 4.0, 0.0)


def open_floor(pose):
    """Return a free space in which everything around the robot was seen free."""
    grid = FreeSpace()
    grid.integrate(pose, scan_of(np.full(180, np.inf)))
    return grid


def straight(start, end):
    share = np.linspace(0, 1, max(int(np.hypot(*(end - start)) / 0.05), 2))[:, None]
    return along(start + share * (end - start))


def along(points):
    """Return a path by these places, and a field that leads back to it from around: off it a metre counts twice."""
    left = np.concatenate([np.cumsum(np.hypot(*np.diff(points[::-1], axis=0).T))[::-1], [0.0]])
    corner = points.min(axis=0) - 1.0
    x, y = (np.arange(low + 0.025, high + 1.0, 0.05) for low, high in zip(corner, points.max(axis=0), strict=True))
    off = np.stack(np.meshgrid(x, y), axis=-1)[:, :, None] - points
    metres = (left + 2.0 * np.hypot(off[..., 0], off[..., 1])).min(axis=-1)
    metres[metres < 0.16] = 0.0
    return Path(points, 1.0, Field(metres[..., None], corner, 0.05))


def pilot_to(goal, pose, grid):
    return Pilot(straight(pose[:2], goal), CONFIG)


def around(pose, scan, grid, recent=NOTHING, touched=NOTHING):
    """Return what a pilot looks at."""
    seen = Mock(spec=Surroundings)
    seen.pose_world, seen.scan, seen.free_space, seen.recent_robot, seen.touched_robot = (
        pose,
        scan,
        grid,
        recent,
        touched,
    )
    return seen


@few
@given(st.integers(0, 2**32))
def test_the_disc_keeps_clear_of_all_returns_on_the_whole_step(seed):
    """The way of the disc is sampled a hundred times as densely as needed; only a step that leads away may be tight."""
    rng = np.random.default_rng(seed)
    pose = np.append(rng.uniform(-1, 1, 2), rng.uniform(-3, 3))
    grid = open_floor(pose)
    pilot = pilot_to(pose[:2] + rng.uniform(-1.5, 1.5, 2), pose, grid)
    ranges = rng.uniform(rng.choice([0.21, 0.3]), 1.2, 180)
    ranges[rng.random(180) < rng.uniform(0, 0.95)] = np.inf
    scan = scan_of(ranges)
    command = pilot.command(around(pose, scan, grid))
    if command is None or command.forward_m == 0.0 or not len(returns(scan, AT_AXLE)):
        return
    points = returns(scan, AT_AXLE)
    places = np.stack([arc(s * command.forward_m, s * command.turn_rad)[:2] for s in np.linspace(0, 1, 100)])
    gap = np.hypot(*np.moveaxis(points - places[:, None], -1, 0))
    now = gap[0].min()
    assert gap.min() > CONFIG.radius_m
    clear = CONFIG.radius_m + CONFIG.clear_m + CONFIG.clear_share * abs(command.forward_m)
    assert gap.min() >= min(clear, now) - 2e-3  # between the samples of its own check


@pytest.mark.parametrize("ahead", [0.01, 0.03, 0.06])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_no_step_leads_nearer_to_a_lone_corner_than_a_tenth_of_it_and_four_millimetres(ahead, side):
    """With noise a corner 0.201 m away showed 0.208 m, and 5 mm of that were taken: the robot touched it."""
    pose = np.zeros(3)
    grid = open_floor(pose)
    corner = np.array([ahead, side * np.sqrt(0.208**2 - ahead**2)])
    ranges = np.full(180, np.inf)
    at = np.argmin(np.abs(BEARINGS - np.arctan2(corner[1], corner[0])))
    ranges[at] = np.hypot(*corner)
    scan = scan_of(ranges)
    command = pilot_to(np.array([1.0, 0.0]), pose, grid).command(around(pose, scan, grid))
    assert command is not None
    places = np.stack([arc(s * command.forward_m, s * command.turn_rad)[:2] for s in np.linspace(0, 1, 50)])
    gap = np.hypot(*(returns(scan, AT_AXLE)[0] - places).T)
    clear = CONFIG.radius_m + CONFIG.clear_m + CONFIG.clear_share * abs(command.forward_m)
    assert gap.min() >= min(gap[0], clear) - 5e-4  # between the samples of its own check


def test_a_corner_that_this_scan_shows_too_far_stands_where_all_scans_show_it_on_the_mean():
    ranges = np.full(180, np.inf)
    at = int(np.argmin(np.abs(BEARINGS + 0.97)))
    ranges[at] = 0.239
    recent = AccumulatedReturns()
    for _ in range(SCANS):
        recent.see(scan_of(np.where(np.isfinite(ranges), 0.224, np.inf)))
    seen = obstacles(around(np.zeros(3), scan_of(ranges), None, recent.points_robot), CONFIG)
    np.testing.assert_allclose(np.hypot(*seen.T), 0.227, atol=1e-9)


def test_what_the_scans_before_saw_and_this_one_does_not_counts_and_what_the_body_touched():
    scan = Scan(np.linspace(-2.0, 2.0, 115), np.full(115, np.inf), 0.01, 4.0, 0.0)
    recent, touched = np.array([[-0.3, 0.05], [0.3, 0.05]]), np.array([[0.21, 0.0]])
    seen = obstacles(around(np.zeros(3), scan, None, recent, touched), CONFIG)
    np.testing.assert_array_equal(seen, np.vstack([recent, touched]))


@few
@given(st.integers(0, 2**32))
def test_commands_are_short_steps_and_small_turns(seed):
    rng = np.random.default_rng(seed)
    pose = np.append(rng.uniform(-1, 1, 2), rng.uniform(-3, 3))
    grid = open_floor(pose)
    pilot = pilot_to(pose[:2] + rng.uniform(-1.5, 1.5, 2), pose, grid)
    command = pilot.command(around(pose, scan_of(np.full(180, np.inf)), grid))
    assert command is not None
    assert abs(command.forward_m) <= CONFIG.robot.step_m
    assert abs(command.turn_rad) <= CONFIG.robot.turn_rad + 1e-12


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.1, -2.0])
def test_the_robot_gets_to_the_end_of_a_free_path(heading):
    pose = np.array([0.0, 0.0, heading])
    grid, goal = open_floor(pose), np.array([1.5, 0.8])
    pilot = pilot_to(goal, pose, grid)
    for _ in range(80):
        if pilot.arrived(pose):
            break
        command = pilot.command(around(pose, scan_of(np.full(180, np.inf)), grid))
        assert command is not None
        pose = compose(pose, arc(command.forward_m, command.turn_rad))
    assert np.hypot(*(pose[:2] - goal)) < 0.1


def test_past_a_post_beside_its_path_the_robot_drives_and_before_a_wall_across_it_there_is_no_step_in_the_end():
    grid, goal = open_floor(np.zeros(3)), np.array([1.5, 0.0])
    post = np.array([[[0.7, 0.14], [0.72, 0.12]], [[0.72, 0.12], [0.7, 0.1]], [[0.7, 0.1], [0.7, 0.14]]])
    wall = np.array([[[0.7, 3.0], [0.7, -3.0]]])[:, ::-1]
    for faces, arrives in ((post, True), (wall, False)):
        finder, pose, planner = RangeFinder(faces, LidarConfig()), np.zeros(3), Planner(grid, np.zeros(2), PathConfig())
        pilot = Pilot(planner.to(goal[None]), CONFIG)
        for _ in range(60):
            scan = Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0)
            command = None if pilot.arrived(pose) else pilot.command(around(pose, scan, grid))
            if command is None:
                break
            pose = compose(pose, arc(command.forward_m, command.turn_rad))
            assert not len(faces) or np.hypot(*returns(scan, AT_AXLE).T).min(initial=9.0) > CONFIG.radius_m
        assert pilot.arrived(pose) == arrives
        assert command is None


def test_a_step_onto_floor_that_was_never_seen_is_careful():
    pose = np.zeros(3)
    seen = open_floor(pose)
    blind = FreeSpace()
    blind.integrate(pose, scan_of(np.full(180, 0.3)))
    goal, free = np.array([1.0, 0.0]), scan_of(np.full(180, np.inf))
    bold, careful = (pilot_to(goal, pose, seen).command(around(pose, free, floor)) for floor in (seen, blind))
    assert bold is not None
    assert careful is not None
    assert careful.forward_m <= CONFIG.careful_m < bold.forward_m


@pytest.mark.parametrize("aside_m", [0.3, -0.3])
def test_a_robot_that_cannot_reverse_and_faces_the_wrong_way_turns_the_short_way(aside_m):
    pose, robot = np.zeros(3), RobotSpec(can_reverse=False)
    grid, free = open_floor(pose), scan_of(np.full(180, np.inf))
    path = straight(pose[:2], np.array([-1.5, aside_m]))
    pilot = Pilot(path, DrivingConfig(robot=robot))
    for _ in range(60):
        if pilot.arrived(pose):
            break
        command = pilot.command(around(pose, free, grid))
        assert command.forward_m >= 0.0
        assert command.turn_rad * aside_m >= -0.5 * robot.turn_rad or abs(pose[2]) > 2.0
        pose = compose(pose, arc(command.forward_m, command.turn_rad))
    assert pilot.arrived(pose)


def between(gap_m, rng, aside_m=0.0):
    """Return a noisy scan by a robot that looks along two walls, each 0.1 m long, with a gap between them."""
    half = gap_m / 2.0
    left = np.array([[-0.05, half - aside_m], [0.05, half - aside_m]])
    right = np.array([[0.05, -half - aside_m], [-0.05, -half - aside_m]])
    finder = RangeFinder(np.stack([left[::-1], right[::-1]]), LidarConfig())
    return scan_of_world(finder, np.zeros(3), rng)


@pytest.mark.parametrize("seed", range(4))
def test_out_of_a_door_the_robot_backs_without_turning_round(seed):
    """A turn on the spot slips aside: 25 of them between two walls 0.45 m apart were a collision."""
    rng = np.random.default_rng(seed)
    pose, grid, recent = np.zeros(3), open_floor(np.zeros(3)), AccumulatedReturns()
    for _ in range(SCANS):
        recent.see(between(0.46, rng))
    command = pilot_to(np.array([-1.0, 0.0]), pose, grid).command(
        around(pose, between(0.46, rng), grid, recent.points_robot)
    )
    assert command is not None
    assert command.forward_m < 0.0


@pytest.mark.parametrize("seed", range(6))
def test_round_a_thin_walls_end_the_robot_keeps_to_its_path(seed):
    """The map knows nothing of the wall, so that what the robot aims at, far ahead, lies across its end."""
    rng = np.random.default_rng(seed)
    thin = np.array([[-3.0, -0.045], [0.0, -0.045], [0.0, 0.045], [-3.0, 0.045]])
    finder = RangeFinder(np.stack([thin, np.roll(thin, -1, axis=0)], axis=1)[:3, ::-1], LidarConfig())
    angle = np.linspace(-np.pi / 2, np.pi / 2, 20)[:, None]
    rounding = 0.32 * np.hstack([np.cos(angle), np.sin(angle)])
    out = straight(np.array([0.0, 0.32]), np.array([-1.0, 0.32])).points_world
    start = np.array([*(rng.uniform(0.27, 0.28) * np.array([np.cos(-1.2), np.sin(-1.2)])), rng.uniform(0.2, 0.5)])
    pose, grid, recent = start.copy(), open_floor(start), AccumulatedReturns()
    pilot = Pilot(along(np.vstack([rounding, out])), CONFIG)
    backward = 0
    for _ in range(60):
        if pilot.arrived(pose):
            break
        scan = scan_of_world(finder, pose, rng)
        command = pilot.command(around(pose, scan, grid, recent.points_robot))
        assert command is not None
        backward += command.forward_m < 0.0
        motion = arc(command.forward_m, command.turn_rad)
        recent.see(scan)
        recent.move(Odometry(motion, np.zeros((3, 3))))
        pose = compose(pose, motion)
    assert pilot.arrived(pose), f"{backward} steps back"
    assert backward <= 5


def scan_of_world(finder, pose, rng):
    """Return a noisy scan of drawn walls."""
    ranges = finder.cast(pose)[0]
    return Scan(finder.bearings_rad, ranges + 0.01 * rng.standard_normal(len(ranges)), 0.01, 4.0, 0.0)
