"""The paper's wall following layer: approach, follow, round, reverse, over and over (section 3.1)."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.following import wall_follower as module
from chainslam.explore.following.behaviour import Behaviour
from chainslam.explore.following.driving import Controller
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.track import Track
from chainslam.explore.following.wall_follower import WallFollower
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import arc, compose
from chainslam.slam.map.chains import HEAD, TAIL
from chainslam.slam.robot import MotionCommand, Scan

pytestmark = pytest.mark.usefixtures("_unchecked")

CONFIG = FollowingConfig()
STANDOFF_M = CONFIG.viewpoints.standoff_m


def faces_of(ring):
    """Faces of a ring of corners, free side on the left."""
    corners = np.array(ring, dtype=float)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


HALL = faces_of([(0, 0), (8, 0), (8, 6), (0, 6)])
BOARD = faces_of([(3, 3), (3, 3.1), (5, 3.1), (5, 3)])
"""A free-standing wall of 2 m: its long faces are numbers 5 and 7 of the scene."""


@pytest.fixture
def hall_with_board(scene_of, look):
    room = shapely.box(0, 0, 8, 6).difference(shapely.box(3, 3, 5, 3.1))
    scene = replace(scene_of(0), room=room, faces=np.concatenate([HALL, BOARD]), grid=FreeSpace())
    look(scene, np.array([[1.0, 1.0], [7.0, 1.0], [7.0, 5.0], [1.0, 5.0], [4.0, 2.0], [4.0, 4.0]]))
    return scene


def drive(scene, follower, pose, steps, slip_m=0.0):
    """Let the robot follow, with turns that slip aside where asked; return its poses, and what it did at each step."""
    finder, poses, words = RangeFinder(scene.faces, LidarConfig()), [pose], []
    for _ in range(steps):
        scan = Scan(finder.bearings_rad, finder.cast(poses[-1])[0], 0.01, 4.0, 0.0)
        command = follower.command(Surroundings(scene.walls(poses[-1]), scene.grid, scan))
        if command is None:
            break
        words.append(follower.behaviour)
        aside = np.array([0.0, slip_m * (command.forward_m == 0.0), 0.0])
        poses.append(compose(poses[-1], arc(command.forward_m, command.turn_rad) + aside))
    return np.array(poses), words


@pytest.mark.parametrize("side", [TAIL, HEAD])
def test_the_robot_goes_to_and_fro_along_a_free_wall_until_another_is_given(hall_with_board, side):
    follower = WallFollower(7, side, CONFIG)
    poses, words = drive(hall_with_board, follower, np.array([1.0, 1.0, 0.0]), 500)
    assert len(words) == 500
    assert follower.ping_pongs >= 2
    at_ends = [np.flatnonzero(poses[:, 0] < 2.9), np.flatnonzero(poses[:, 0] > 5.1)]
    assert min(len(np.flatnonzero(np.diff(steps) > 20)) for steps in at_ends) >= 1, "it came back to each end"
    assert set(words) == {Behaviour.APPROACH, Behaviour.FOLLOW, Behaviour.ROUND, Behaviour.REVERSE}
    changes = [b for a, b in pairwise([None, *words]) if a is not b]
    assert changes[0] is Behaviour.APPROACH
    assert Behaviour.APPROACH not in changes[1:]
    reverses = [k for k, word in enumerate(changes) if word is Behaviour.REVERSE]
    assert all(changes[k - 1] is Behaviour.ROUND for k in reverses)
    boards = shapely.box(3, 3, 5, 3.1)
    assert shapely.distance(shapely.MultiPoint(poses[:, :2]), boards) > CONFIG.robot.radius_m


@pytest.mark.parametrize("side", [TAIL, HEAD])
def test_it_follows_and_rounds_at_the_set_distance(hall_with_board, side):
    poses, words = drive(hall_with_board, WallFollower(7, side, CONFIG), np.array([4.0, 2.0, 0.0]), 400)
    face = shapely.LineString([(3, 3), (5, 3)])
    gaps = shapely.distance(shapely.points(poses[:-1, :2]), face)
    for word in (Behaviour.FOLLOW, Behaviour.ROUND):
        own = gaps[np.array(words) == word]
        assert np.median(own) == pytest.approx(STANDOFF_M, abs=0.03)
        assert own.max() < 1.5 * STANDOFF_M


def test_it_goes_round_an_end_until_no_motion_is_left(hall_with_board):
    """A thin wall lets it round by more than half a circle: the wall's other face is what stops it."""
    poses, words = drive(hall_with_board, WallFollower(7, HEAD, CONFIG), np.array([4.0, 2.0, 0.0]), 200)
    turned = words.index(Behaviour.REVERSE)
    assert poses[turned, 1] > 3.1 + CONFIG.robot.radius_m
    assert 2.0 < poses[turned, 0] < 6.0


def test_in_an_inner_corner_it_turns_back_where_the_next_wall_stands(hall_with_board):
    poses, words = drive(hall_with_board, WallFollower(0, HEAD, CONFIG), np.array([4.0, 1.0, 0.0]), 300)
    turned = words.index(Behaviour.REVERSE)
    assert poses[turned, 0] == pytest.approx(8.0 - CONFIG.robot.radius_m, abs=0.15)
    back = words.index(Behaviour.REVERSE, words.index(Behaviour.FOLLOW, turned))
    assert poses[back, 0] == pytest.approx(CONFIG.robot.radius_m, abs=0.15)
    assert Behaviour.ROUND not in words


@pytest.mark.parametrize("seed", range(6))
def test_from_anywhere_every_wall_is_approached_and_nothing_is_touched(scene_of, seed):
    """Rooms with blocks, walls and places by chance: the body keeps clear, and most walls are followed."""
    scene, rng, followed = scene_of(seed), np.random.default_rng(seed), Counter()
    for _ in range(3):
        wall, place = int(rng.integers(len(scene.faces))), scene.places[rng.integers(30)]
        poses, words = drive(scene, WallFollower(wall, None, CONFIG), np.append(place, rng.uniform(-3, 3)), 150)
        assert shapely.distance(shapely.MultiPoint(poses[:, :2]), scene.room.boundary) > CONFIG.robot.radius_m
        followed[bool(set(words) & {Behaviour.FOLLOW, Behaviour.ROUND})] += 1
    assert followed[True] >= 1


def test_a_narrow_passage_takes_the_standoff_but_not_the_clearance(scene_of, look):
    """Along a corridor of 0.5 m, where the stand-off would touch the other side."""
    room = shapely.box(0, 0, 5, 0.5)
    scene = replace(scene_of(0), room=room, faces=faces_of([(0, 0), (5, 0), (5, 0.5), (0, 0.5)]), grid=FreeSpace())
    look(scene, np.array([[1.0, 0.25], [4.0, 0.25]]))
    poses, words = drive(scene, WallFollower(0, HEAD, CONFIG), np.array([1.0, 0.25, 0.0]), 120)
    assert shapely.distance(shapely.MultiPoint(poses[:, :2]), room.boundary) > CONFIG.robot.radius_m
    assert poses[:, 0].max() > 4.5
    assert Behaviour.FOLLOW in words


def test_where_thirty_steps_lead_no_farther_the_robot_turns_back(hall_with_board):
    """Wheels that slip: it is told to drive and stays where it is."""
    follower, pose = WallFollower(7, HEAD, CONFIG), np.array([4.0, 3.0 - STANDOFF_M, np.pi])
    finder = RangeFinder(hall_with_board.faces, LidarConfig())
    scan = Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0)
    around, turns = Surroundings(hall_with_board.walls(pose), hall_with_board.grid, scan), []
    for _ in range(140):
        follower.command(around)
        turns.append(follower.ping_pongs)
    assert [turns.index(1), turns.index(2)] == pytest.approx([2 * 31, 4 * 31], abs=4)


@pytest.mark.parametrize(
    ("safe", "turns"), [("yes no yes", [0, 0, 0]), ("no yes no", [0, 0, 0]), ("yes no no", [0, 0, 1])]
)
def test_one_scan_without_a_safe_step_is_followed_by_another_and_two_turn_the_robot(
    hall_with_board, monkeypatch, safe, turns
):
    follower, pose = WallFollower(7, HEAD, CONFIG), np.array([4.0, 3.0 - STANDOFF_M, np.pi])
    finder = RangeFinder(hall_with_board.faces, LidarConfig())
    scan = Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0)
    around, sides = Surroundings(hall_with_board.walls(pose), hall_with_board.grid, scan), []
    for word in safe.split():
        with monkeypatch.context() as patched:
            if word == "no":
                patched.setattr(Controller, "command", lambda *_: None)
            command = follower.command(around)
        sides.append(int(follower.behaviour is Behaviour.REVERSE))
        assert command == MotionCommand(0.0, 0.0) if word == "no" else command.forward_m > 0.1
    assert sides == turns


TRACK = Track(np.array([0.0, 0.0]), np.array([1.0, 0.0]), np.array([0.0, -1.0]), 2.0, 0.4)


@pytest.mark.parametrize(
    ("was_on", "position_m", "distance_m", "is_on"),
    [
        (False, 1.0, 0.5, True), (False, 1.0, 0.55, False), (False, 1.0, 0.3, True), (False, 1.0, 0.25, False),
        (True, 1.0, 0.55, True), (True, 1.0, 0.79, True), (True, 1.0, 0.81, False), (True, 1.0, 0.02, True),
        (False, -1.2, 0.4, True), (False, -1.3, 0.4, False), (True, -1.3, 0.4, True),
        (False, 3.2, 0.4, True), (False, 3.3, 0.4, False), (True, 3.3, 0.4, True),
    ],
)  # fmt: skip
def test_the_track_begins_near_the_standoff_and_ends_at_twice_it(was_on, position_m, distance_m, is_on):
    """Round an end by half a circle at most; who is on it may have gone round farther."""
    follower = WallFollower(0, TAIL, CONFIG)
    assert follower._on_track(TRACK, 1.0, 0.4 if was_on else 4.0) == was_on
    assert follower._on_track(TRACK, position_m, distance_m) == is_on


@pytest.mark.parametrize("side", [TAIL, HEAD])
def test_without_a_side_the_nearer_end_is_first(hall_with_board, side):
    follower = WallFollower(7, None, CONFIG)
    start = np.array([4.0 + (0.5 if side == TAIL else -0.5), 3.0 - STANDOFF_M, 0.0 if side == TAIL else np.pi])
    poses, _ = drive(hall_with_board, follower, start, 4)
    assert np.sign(poses[-1, 0] - start[0]) == (1.0 if side == TAIL else -1.0)


def test_what_stands_in_the_way_unseen_turns_it_back_on_its_track_only():
    follower = WallFollower(0, TAIL, CONFIG)
    follower.interrupt(None)
    assert follower.behaviour is Behaviour.APPROACH
    assert follower._on_track(TRACK, 1.0, 0.4)
    follower.interrupt(None)
    follower.interrupt(None)
    assert (follower.behaviour, follower.ping_pongs) == (Behaviour.REVERSE, 1)


def test_over_floor_that_was_not_seen_its_steps_are_short(hall_with_board):
    pose = np.array([4.0, 3.0 - STANDOFF_M, np.pi])
    finder, floor = RangeFinder(hall_with_board.faces, LidarConfig()), FreeSpace()
    scan, steps = Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0), []
    floor.integrate(np.array([7.0, 5.0, 0.0]), Scan(finder.bearings_rad, np.full(180, 0.3), 0.01, 4.0, 0.0))
    for seen in (hall_with_board.grid, floor):
        around = Surroundings(hall_with_board.walls(pose), seen, scan)
        steps.append(WallFollower(7, HEAD, CONFIG).command(around).forward_m)
    assert steps[0] > CONFIG.driving.careful_m == steps[1]


@pytest.mark.parametrize("trouble", ["", "no way leads there"])
def test_an_approach_that_comes_as_near_as_the_floor_allows_is_followed_one_in_trouble_is_not(
    hall_with_board, monkeypatch, trouble
):
    class Arrived:
        def __init__(self, *_):
            self.trouble = trouble

        def command(self, around):
            return None

    monkeypatch.setattr(module, "PlaceErrand", Arrived)
    pose = np.array([4.0, 3.0 - 1.6 * STANDOFF_M, np.pi])
    finder, follower = RangeFinder(hall_with_board.faces, LidarConfig()), WallFollower(7, HEAD, CONFIG)
    scan = Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0)
    command = follower.command(Surroundings(hall_with_board.walls(pose), hall_with_board.grid, scan))
    assert (command is None) == bool(trouble)
    assert follower.trouble == trouble
    assert follower._is_on_track == (not trouble)


def test_a_wall_that_is_gone_is_not_followed(scene_of):
    scene = scene_of(0)
    follower = WallFollower(999, None, CONFIG)
    poses, words = drive(scene, follower, np.append(scene.places[0], 0.0), 5)
    assert (len(poses), words) == (1, [])
    assert "999" in follower.trouble


def test_where_no_motion_leads_along_the_wall_either_way_it_ends_and_says_so(scene_of, look):
    room = shapely.box(0, 0, 0.46, 0.46)
    scene = replace(
        scene_of(0), room=room, faces=faces_of([(0, 0), (0.46, 0), (0.46, 0.46), (0, 0.46)]), grid=FreeSpace()
    )
    look(scene, np.array([[0.23, 0.23]]))
    follower = WallFollower(0, HEAD, CONFIG)
    poses, words = drive(scene, follower, np.array([0.23, 0.23, 1.0]), 200)
    assert len(words) < 100
    assert "no motion along wall 0" in follower.trouble
    assert shapely.distance(shapely.MultiPoint(poses[:, :2]), room.boundary) > CONFIG.robot.radius_m


@pytest.mark.parametrize("slip_m", [-0.003, 0.003])
def test_it_steps_away_from_a_wall_before_it_turns_on_the_spot(scene_of, look, slip_m):
    """At the end of a corridor of 0.6 m it turns by half a circle, and each of the 18 turns slips aside."""
    room = shapely.box(0, 0, 3, 0.6)
    scene = replace(scene_of(0), room=room, faces=faces_of([(0, 0), (3, 0), (3, 0.6), (0, 0.6)]), grid=FreeSpace())
    look(scene, np.array([[1.0, 0.3], [2.0, 0.3]]))
    poses, words = drive(scene, WallFollower(0, HEAD, CONFIG), np.array([1.0, 0.3, 0.0]), 250, slip_m)
    assert Behaviour.REVERSE in words
    assert shapely.distance(shapely.MultiPoint(poses[:, :2]), room.boundary) > CONFIG.robot.radius_m
    assert np.ptp(poses[100:, 0]) > 2.0
