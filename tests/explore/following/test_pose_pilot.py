"""Steps of a body with an outline: against shapely, and along paths with headings."""

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.following.driving import Pilot
from chainslam.explore.following.driving_config import DrivingConfig
from chainslam.explore.following.pose_pilot import PosePilot, pilot_of
from chainslam.explore.following.safe_steps import is_safe, keeps_clear, least_gap, step_away, step_towards
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Path, Planner
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import arc, compose, to_world
from chainslam.slam.robot import MotionCommand, RobotSpec, Scan, fitted
from tests.slam.test_mapper import faces_of

LONG = RobotSpec(outline_m=((0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.5, -0.2)))
CONFIG = fitted(DrivingConfig(), LONG)


def planner_of(robot):
    floor, scan = FreeSpace(fitted(FreeSpaceConfig(), robot)), RangeFinder(faces_of(DOOR), LidarConfig())
    floor.integrate(np.array([1.5, 1.2, 0.0]), Scan(scan.bearings_rad, np.full(180, 1.0), 0.01, 4.0, 0.0))
    return Planner(floor, np.array([1.5, 1.2]), fitted(PathConfig(), robot))


def body_at(pose):
    return shapely.Polygon(to_world(np.array(LONG.outline_m), np.asarray(pose)))


def test_the_least_gap_on_a_way_is_shapelys():
    rng = np.random.default_rng(3)
    for _ in range(30):
        command = MotionCommand(rng.uniform(-0.15, 0.15), rng.uniform(-0.17, 0.17))
        points = rng.uniform(0.75, 1.0, (20, 1)) * np.array([[np.cos(t), np.sin(t)] for t in rng.uniform(-3, 3, 20)])
        bodies = [body_at(arc(s * command.forward_m, s * command.turn_rad)) for s in (0.25, 0.5, 0.75, 1.0)]
        away = min(body.distance(shapely.MultiPoint(points)) for body in bodies)
        assert least_gap(command, points, LONG) == pytest.approx(LONG.radius_m + away, abs=1e-9)


def test_a_turn_into_a_wall_is_refused_and_one_away_from_it_is_not():
    """A post stands ahead of the left front corner, where a turn to the left takes that corner."""
    post = np.array([[0.47, 0.245]])
    assert not is_safe(MotionCommand(0.0, 0.17), post, CONFIG, narrow=False)
    assert is_safe(MotionCommand(0.0, -0.17), post, CONFIG, narrow=False)
    assert step_towards(np.array([0.0, 1.0]), post, CONFIG, narrow=False) is None
    assert step_towards(np.array([0.0, -1.0]), post, CONFIG, narrow=False) == MotionCommand(0.0, -LONG.turn_rad)
    assert not keeps_clear(MotionCommand(0.1, 0.0), np.array([[0.55, 0.1]]), CONFIG)
    assert keeps_clear(MotionCommand(0.1, 0.0), np.array([[0.3, 0.25]]), CONFIG)


def test_a_step_away_from_a_wall_ahead_goes_back():
    wall = np.column_stack([np.full(9, 0.51), np.linspace(-0.3, 0.3, 9)])
    away = step_away(wall, CONFIG)
    assert away is not None
    assert away.forward_m < 0.0


DOOR = shapely.box(0, 0, 6, 4).difference(
    shapely.union_all([shapely.box(3.0, -0.1, 3.1, 1.75), shapely.box(3.0, 2.25, 3.1, 4.1)])
)


@pytest.mark.parametrize("seed", range(3))
def test_a_path_through_a_narrow_door_is_driven_without_touching_it(seed):
    """The body is 0.4 m wide and 0.8 m long, the door 0.5 m; noise of ranges, no slip."""
    rng, finder = np.random.default_rng(seed), RangeFinder(faces_of(DOOR), LidarConfig(beams=360, range_max_m=6.0))
    floor, pose = FreeSpace(fitted(FreeSpaceConfig(), LONG)), np.array([1.5, 1.2, 1.5])
    goal = np.array([[4.5, 2.6]])

    def sensed():
        ranges = finder.cast(pose)[0] + 0.01 * rng.standard_normal(360)
        return Scan(finder.bearings_rad, ranges, 0.01, 6.0, 0.0)

    for place in ([1.5, 1.2, 0.0], [2.6, 2.0, 0.0], [3.6, 2.0, 0.0], [4.5, 2.6, 0.0]):
        floor.integrate(np.array(place), Scan(finder.bearings_rad, finder.cast(np.array(place))[0], 0.01, 6.0, 0.0))
    paths = fitted(PathConfig(), LONG)
    planner = Planner(floor, pose[:2], paths, None, float(pose[2]))
    pilot = pilot_of(planner.to(goal), planner, CONFIG)
    assert isinstance(pilot, PosePilot)
    for _ in range(120):
        scan = sensed()
        if pilot.arrived(pose):
            break
        command = None if pilot.is_obstructed(pose, scan) else pilot.command(pose, scan, floor)
        if command is None:
            planner = Planner(floor, pose[:2], paths, None, float(pose[2]))
            pilot = pilot_of(planner.to(goal), planner, CONFIG)
            continue
        pose = compose(pose, arc(command.forward_m, command.turn_rad))
        assert DOOR.contains(body_at(pose))
    assert np.hypot(*(pose[:2] - goal[0])) < 0.1


def test_a_return_within_the_body_further_on_is_in_the_way():
    path = Path(np.column_stack([np.arange(0.0, 2.0, 0.05), np.zeros(40)]), 2.0, 0, np.zeros(40))
    pilot = PosePilot(path, planner_of(LONG), CONFIG)
    beams = 2.0 * np.pi * np.arange(360) / 360 - np.pi

    def scan_with(point):
        ranges = np.full(360, np.inf)
        ranges[int(np.argmin(np.abs(beams - np.arctan2(point[1], point[0]))))] = np.hypot(*point)
        return Scan(beams, ranges, 0.01, 4.0, 0.0)

    assert pilot.is_obstructed(np.zeros(3), scan_with([0.75, 0.1]))
    assert not pilot.is_obstructed(np.zeros(3), scan_with([0.75, 0.3]))
    assert pilot.remaining_m == pytest.approx(1.95)


def test_a_disc_has_the_pilot_that_it_had():
    disc = RobotSpec()
    assert type(pilot_of(Path(np.zeros((2, 2)), 1.0, 0), planner_of(disc), DrivingConfig())) is Pilot


def test_a_long_body_leaves_room_for_what_its_corners_swing_out_where_the_wheels_slip():
    """With 20 mm beside it a step of 5 cm is too long: its corner may swing out by 14 mm. One of 5 mm is not."""
    pilot = PosePilot(Path(np.zeros((2, 2)), 1.0, 0, np.zeros(2)), planner_of(LONG), CONFIG)
    beside_m = LONG.radius_m + 0.02
    assert not pilot._is_safe(MotionCommand(0.05, 0.0), beside_m, beside_m + 0.01, narrow=True)
    assert pilot._is_safe(MotionCommand(0.005, 0.0), beside_m, beside_m + 0.01, narrow=True)
    assert not pilot._is_safe(MotionCommand(0.005, 0.0), LONG.radius_m + 0.005, LONG.radius_m, narrow=True)
