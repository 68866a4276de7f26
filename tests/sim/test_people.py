"""People in a building: they never walk through walls, through the robot or each other, and hide what is behind."""

import numpy as np
import pytest
import shapely

from chainslam.sim.chance import Chance
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.people import People, PeopleConfig, hidden_by
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.robot import MotionCommand, RobotError
from tests.sim.test_robot import room

BODY_M = 0.2


def walked(walking, seed, steps=200, robot=(1.0, 1.0)):
    """Where everybody was at each step, past a robot that stands."""
    world = room()
    people = People(PeopleConfig(walking=walking), world.faces, Chance(seed, 7), BODY_M)
    robot = np.array(robot)
    people.enter(robot, 4.0)
    found = [people.places_at(0.0).copy()]
    for _ in range(steps):
        people.walk(0.3, robot)
        found.append(people.places_at(0.0).copy())
    return world, np.array(found), robot


@pytest.mark.parametrize("seed", range(4))
def test_people_keep_clear_of_walls_of_the_robot_and_of_each_other(seed):
    world, places, robot = walked(2, seed)
    config = PeopleConfig()
    assert places.shape[1] >= 1
    flat = places.reshape(-1, 2)
    assert distance_to_segments(flat, world.faces).min() >= config.radius_m + config.keep_m - 1e-9
    assert np.hypot(*(flat - robot).T).min() >= config.radius_m + BODY_M + config.keep_m - 1e-9
    if places.shape[1] > 1:
        apart = np.hypot(*(places[:, 0] - places[:, 1]).T)
        assert apart.min() > 2.0 * config.radius_m
    steps = np.hypot(*np.moveaxis(np.diff(places, axis=0), -1, 0))
    assert np.all((steps < 1e-12) | np.isclose(steps, 0.3 * config.speed_m_s))
    assert (steps > 0.0).mean() > 0.5


BOX = np.array([[[0.0, 0.0], [6.0, 0.0]], [[6.0, 0.0], [6.0, 6.0]], [[6.0, 6.0], [0.0, 6.0]], [[0.0, 6.0], [0.0, 0.0]]])
THIN = np.array([[[2.0, 0.0], [2.0, 5.0]]])


@pytest.mark.parametrize("seed", range(6))
def test_people_enter_within_reach_and_in_sight_of_the_robot(seed):
    robot, faces = np.array([1.0, 2.0]), np.concatenate([BOX, THIN])
    people = People(PeopleConfig(walking=3), faces, Chance(seed, 7), BODY_M)
    people.enter(robot, 2.5)
    assert len(people.places_at(0.0))
    for place in people.places_at(0.0):
        assert 1.0 <= np.hypot(*(place - robot)) <= 2.5
        assert not shapely.intersects(shapely.linestrings([robot, place]), shapely.linestrings(faces)).any()


@pytest.mark.parametrize("seed", range(3))
def test_who_walks_goes_straight_on_until_something_is_in_the_way(seed):
    robot = np.array([3.0, 3.0])
    config = PeopleConfig(walking=1)
    people = People(config, BOX, Chance(seed, 7), BODY_M)
    people.enter(robot, 3.0)
    places = [people.places_at(0.0)[0].copy()]
    for _ in range(120):
        people.walk(0.3, robot)
        places.append(people.places_at(0.0)[0].copy())
    steps = np.diff(places, axis=0)
    body = config.radius_m + config.keep_m
    for place, before, step in zip(places[1:], steps, steps[1:], strict=False):
        ahead = place + before
        is_free = distance_to_segments(ahead[None], BOX).min() > body and np.hypot(*(ahead - robot)) > body + BODY_M
        if is_free and np.any(before):
            np.testing.assert_allclose(step, before, atol=1e-9)
    assert (np.hypot(*steps.T) > 0.0).mean() > 0.95


def test_the_same_seed_brings_the_same_people_and_another_one_others():
    first, again, other = (walked(2, seed, 20)[1] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or not np.allclose(first, other)


def test_a_disc_hides_what_is_behind_it_and_nothing_else():
    """Held against the nearest of many points on the rim of each disc, in the narrow sector of each beam."""
    rng = np.random.default_rng(1)
    bearings = np.linspace(-np.pi, np.pi, 90, endpoint=False)
    for _ in range(20):
        scanner, places = rng.uniform(-1, 1, 2), rng.uniform(-4, 4, (3, 2))
        places = places[np.hypot(*(places - scanner).T) > 0.5]
        found = hidden_by(np.full(90, 3.0), bearings, scanner, places, 0.25)
        ways = np.linspace(0.0, 3.0, 3001)
        for bearing, told in zip(bearings, found, strict=True):
            points = scanner + ways[:, None] * [np.cos(bearing), np.sin(bearing)]
            inside = (np.hypot(*np.moveaxis(points[:, None] - places, -1, 0)) < 0.25).any(axis=1)
            first = ways[np.argmax(inside)] if inside.any() else 3.0
            assert told == pytest.approx(first, abs=2e-3) or (told < 3.0 and first == 3.0 and told > 0.0)
    within = hidden_by(np.full(90, 3.0), bearings, np.zeros(2), np.array([[0.1, 0.0]]), 0.25)
    assert within.min() == 1e-3, "somebody around the scanner is as near as can be"


def test_who_stands_is_seen_touched_and_gone():
    people = PeopleConfig(standing=(1.6, 1.0), leave_s=1.0)
    world = room()
    start = np.array([1.0, 1.0, 0.0])
    config = RobotConfig(lidar=LidarConfig(sigma_m=1e-6), faults=FaultsConfig(people=people))
    robot = SimulatedRobot(type("Drawn", (), {"faces": world.faces, "start": start})(), 1, True, config)
    scan = robot.sense()
    ahead = int(np.argmin(np.abs(scan.bearings_rad)))
    assert scan.ranges_m[ahead] == pytest.approx(0.4, abs=1e-5)
    assert robot.record.faces_of_beams[0][ahead] == -1
    reports = [robot.drive(MotionCommand(0.1, 0.0)) for _ in range(3)]
    assert [report.touched for report in reports] == [False, True, True]
    assert robot.true_pose[0] == pytest.approx(1.2, abs=0.01)
    while robot.sense().time_s < 1.0:
        pass
    later = robot.sense()
    assert later.ranges_m[ahead] > 0.5


@pytest.mark.parametrize("wrong", [{"walking": -1}, {"standing": (1.0,)}, {"radius_m": 0.0}, {"speed_m_s": -1.0}])
def test_people_that_cannot_be_are_told(wrong):
    with pytest.raises(RobotError, match="expected"):
        RobotConfig(faults=FaultsConfig(people=PeopleConfig(**wrong)))
