"""Steps of a body with an outline: against shapely, and along paths with headings."""

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.accumulated_returns import returns
from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.following.driving import Pilot, keeps_clear, motions_of, out_of_view, spin
from chainslam.explore.following.driving_config import DrivingConfig
from chainslam.explore.following.motion_kernels import clearance_m
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Planner
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import arc, compose, to_world
from chainslam.slam.robot import MotionCommand, RobotSpec, Scan, fitted
from tests.explore.following.test_driving import around, straight
from tests.slam.test_mapper import faces_of

LONG = RobotSpec(outline_m=((0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.5, -0.2)))
CONFIG = fitted(DrivingConfig(), LONG)


def body_at(pose):
    return shapely.Polygon(to_world(np.array(LONG.outline_m), np.asarray(pose)))


def test_the_clearance_of_a_body_is_shapelys():
    rng, motions = np.random.default_rng(3), motions_of(CONFIG)[1]
    for _ in range(30):
        pose, points = rng.uniform(-3.0, 3.0, 3), rng.uniform(-4.0, 4.0, (20, 2))
        body = body_at(pose)
        away = [body.distance(point) or -body.exterior.distance(point) for point in shapely.points(points)]
        assert clearance_m(*pose, points, motions, 9.0) == pytest.approx(min(away), abs=1e-9)
        assert clearance_m(*pose, points, motions, -1.0) == -1.0


def test_what_a_body_does_not_cover_yet_it_does_not_come_to_cover_on_the_way_back():
    post = np.array([[0.47, 0.245]])
    assert not keeps_clear(MotionCommand(0.0, 0.17), post, CONFIG)
    assert keeps_clear(MotionCommand(0.0, -0.17), post, CONFIG)
    assert not keeps_clear(MotionCommand(0.1, 0.0), np.array([[0.55, 0.1]]), CONFIG)
    assert keeps_clear(MotionCommand(0.1, 0.0), np.array([[0.3, 0.25]]), CONFIG)


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
    pilot = Pilot(planner.to(goal), CONFIG)
    for _ in range(120):
        scan = sensed()
        if pilot.arrived(pose):
            break
        command = pilot.command(around(pose, scan, floor))
        if command is None:
            planner = Planner(floor, pose[:2], paths, None, float(pose[2]))
            pilot = Pilot(planner.to(goal), CONFIG)
            continue
        pose = compose(pose, arc(command.forward_m, command.turn_rad))
        assert DOOR.contains(body_at(pose))
    assert np.hypot(*(pose[:2] - goal[0])) < 0.1


def test_a_long_body_leaves_room_for_what_its_corners_swing_out_where_the_wheels_slip():
    """On a step of 5 cm its corner may swing out by 1 cm more than a disc does."""
    (commands, long), (_, disc) = motions_of(CONFIG), motions_of(DrivingConfig())
    error_m = DrivingConfig().clear_m
    swings = np.sqrt(np.maximum((long.clear_m - disc.clear_m + error_m) ** 2 - error_m**2, 0.0))
    swing = dict(zip([(c.forward_m, c.turn_rad) for c in commands], swings, strict=True))
    assert swing[0.15 / 3.0, 0.0] == pytest.approx(0.0107, abs=5e-4)
    assert swing[0.13 * 0.15, 0.0] < swing[0.15 / 3.0, 0.0] < swing[0.15, 0.0]


@pytest.mark.parametrize("seed", range(12))
def test_a_turn_on_the_spot_touches_nothing_that_the_scan_shows(seed):
    """It turns the other way, by less, or not at all; with room on all sides it turns as it was asked to."""
    rng, pose = np.random.default_rng(seed), np.zeros(3)
    bearings = -np.pi + np.arange(360) * np.deg2rad(1.0)
    beams = shapely.linestrings(np.stack([np.zeros((360, 2)), np.stack([np.cos(bearings), np.sin(bearings)], -1)], 1))
    far = shapely.length(shapely.intersection(beams, body_at(pose)))
    ranges = np.full(360, np.inf)
    hit = rng.random(360) < 0.03
    ranges[hit] = far[hit] + rng.uniform(0.01, 0.1, hit.sum())
    for shown in (ranges, np.full(360, np.inf)):
        scan = Scan(bearings, shown, 0.001, 6.0, 0.0)
        command = spin(around(pose, scan, FreeSpace()), 1.0, CONFIG)
        assert command.forward_m == 0.0
        for share in np.linspace(0.0, 1.0, 20):
            points = returns(scan, LONG.scanner)
            assert not shapely.contains_xy(
                body_at([0.0, 0.0, share * command.turn_rad]), points[:, 0], points[:, 1]
            ).any()
    assert command.turn_rad == LONG.turn_rad


def test_what_the_scanner_cannot_see_is_in_the_way_until_a_scan_has_shown_it():
    """The robot does not back into floor behind it that nobody has seen; once it was seen, it does."""
    pose = np.zeros(3)
    bearings = np.deg2rad(np.arange(-120.0, 121.0))
    ahead = Scan(bearings, np.full(241, np.inf), 0.01, 4.0, 0.0)
    unseen, seen = FreeSpace(), FreeSpace()
    for floor in (unseen, seen):
        floor.integrate(pose, ahead)
    all_round = np.deg2rad(np.arange(-180.0, 180.0))
    seen.integrate(pose, Scan(all_round, np.full(360, np.inf), 0.01, 4.0, 0.0))
    for floor, backs in ((unseen, False), (seen, True)):
        seen_now = around(pose, ahead, floor)
        assert (len(out_of_view(seen_now, DrivingConfig())) == 0) == backs
        path = straight(pose[:2], np.array([-0.45, 0.0]))
        command = Pilot(path, DrivingConfig()).command(seen_now)
        assert command is not None
        assert (command.forward_m < 0.0) == backs
