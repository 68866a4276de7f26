"""Which cells of the floor were seen, against loops over cells and beams."""

import numpy as np
import pytest
import shapely

from chainslam.experiments.scoring.maps.swept import CELL_M, SOON, Floor, soon, swept, visible_floor
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World

ROOM = shapely.Polygon(
    [(1.0, -2.0), (4.02, -2.0), (4.02, 0.01), (1.0, 0.01)], [[(2, -1), (2, -1.5), (3, -1.5), (3, -1)]]
)
POSE = np.array([1.5, -0.7, 0.4])
LOSING = FaultsConfig(dropout=0.05)


def cells():
    """Row, column and middle of each cell of the floor's grid."""
    for row in range(41):
        for column in range(61):
            yield row, column, 1.0 + (column + 0.5) * CELL_M, -2.0 + (row + 0.5) * CELL_M


def test_the_floor_is_cut_into_cells_of_five_centimetres():
    floor = Floor(ROOM)
    assert floor.free.shape == floor.seen.shape == (41, 61)
    for row, column, x, y in cells():
        assert floor.free[row, column] == shapely.contains_xy(ROOM, x, y)
    assert not floor.seen.any()


def test_a_region_covers_the_free_cells_within_it():
    floor, disc = Floor(ROOM), shapely.Point(2.0, -1.0).buffer(0.4)
    floor.cover(disc)
    first = floor.seen.copy()
    for row, column, x, y in cells():
        assert floor.seen[row, column] == shapely.contains_xy(disc.intersection(ROOM), x, y)
    floor.cover(shapely.Point(3.5, -0.5).buffer(0.2))
    assert floor.seen[first].all()
    assert floor.seen.sum() > first.sum()


@pytest.mark.parametrize("range_max_m", [0.6, 4.0])
@pytest.mark.parametrize(
    "bearings", [np.linspace(-np.pi, np.pi, 90, endpoint=False), np.linspace(-np.pi / 2, np.pi / 2, 46)]
)
def test_a_cell_is_seen_if_it_lies_before_the_return_of_its_nearest_beam(bearings, range_max_m):
    rng = np.random.default_rng(2)
    ranges = rng.uniform(0.2, 2.0, len(bearings))
    ranges[::7], ranges[3::11], ranges[20:24] = np.nan, np.inf, np.inf
    floor = Floor(ROOM)
    floor.look(POSE, bearings, ranges, range_max_m)
    full = len(bearings) == 90
    half, checked = 0.5 * (bearings[1] - bearings[0]), {True: 0, False: 0}
    for row, column, x, y in cells():
        off = np.angle(np.exp(1j * (np.arctan2(y - POSE[1], x - POSE[0]) - POSE[2] - bearings)))
        nearest = int(np.argmin(np.abs(off)))
        distance = np.hypot(x - POSE[0], y - POSE[1])
        # Beyond the range the grid may hold any cell within its square; where beams end, either neighbour may count.
        if max(abs(x - POSE[0]), abs(y - POSE[1])) > range_max_m - CELL_M or abs(abs(off[nearest]) - half) < 1e-9:
            continue
        beside = ranges[[nearest - 1, (nearest + 1) % len(ranges)]]
        if not full and nearest in (0, len(ranges) - 1):
            beside = np.array([np.inf, np.inf])
        if np.isfinite(ranges[nearest]) or np.isfinite(beside).all():
            reach = ranges[nearest] if np.isfinite(ranges[nearest]) else min(beside)
        else:
            reach = 0.0 if np.isnan(ranges[nearest]) else range_max_m
        expected = bool(floor.free[row, column] and abs(off[nearest]) < half and distance <= reach)
        assert floor.seen[row, column] == expected, (row, column)
        checked[expected] += 1
    assert min(checked.values()) > 20


def test_nothing_beyond_the_range_in_either_direction_is_seen():
    bearings = np.linspace(-np.pi, np.pi, 90, endpoint=False)
    floor = Floor(ROOM)
    floor.look(POSE, bearings, np.full(90, np.inf), 0.6)
    rows, columns = np.nonzero(floor.seen)
    x, y = 1.0 + (columns + 0.5) * CELL_M, -2.0 + (rows + 0.5) * CELL_M
    assert np.abs(x - POSE[0]).max() <= 0.6
    assert np.abs(y - POSE[1]).max() <= 0.6
    assert (x.min() - 1.0, x.max() - 2.1, y.min() + 1.3, y.max() + 0.1) == pytest.approx((0, 0, 0, 0), abs=CELL_M)


def test_the_swept_share_is_of_what_can_be_seen_and_only_grows():
    world = World("room", shapely.geometry.polygon.orient(ROOM), POSE, {})
    config = RobotConfig()
    target = visible_floor(world, config)
    finder = RangeFinder(world.faces, config.lidar)
    poses = np.array([POSE, [3.5, -0.5, 0.0], [3.5, -1.7, 1.0]])
    ranges = np.array([finder.cast(pose)[0] for pose in poses])
    seen, shares = np.zeros_like(target), []
    for k, pose in enumerate(poses):
        floor = Floor(world.free)
        floor.look(pose, finder.bearings_rad, ranges[k], config.lidar.range_max_m)
        seen |= floor.seen
        shares.append(np.sum(seen & target) / np.sum(target))
    assert swept(world, config, poses, finder.bearings_rad, ranges) == pytest.approx(shares)
    assert 0.4 < shares[0] < shares[1] < shares[2] <= 1.0


def in_sight(points, others, range_m):
    """Whether a straight line in the room joins each of the points with each of the others, within range."""
    ends = np.broadcast_arrays(points[:, None], others[None])
    lines = shapely.linestrings(np.stack(ends, axis=2))
    return (shapely.length(lines) <= range_m) & shapely.covers(ROOM, lines)


def test_how_soon_the_floor_is_seen_agrees_with_lines_of_sight_on_a_grid_of_its_own():
    """Ten centimetres a point; what can be seen is in sight of some place of the body's middle."""
    shapely.prepare(ROOM)
    world = World("room", shapely.geometry.polygon.orient(ROOM), POSE, {})
    config = RobotConfig(radius_m=0.2, lidar=LidarConfig(beams=1440, range_max_m=1.0))
    corners = np.array([[1.5, -0.7], [3.5, -0.7], [3.5, -1.75], [1.5, -1.75]])
    path = shapely.LinearRing(corners)
    way = np.arange(0.0, 0.97 * path.length, 0.1)
    poses = np.column_stack([shapely.get_coordinates(shapely.line_interpolate_point(path, way)), 0.3 * way])
    finder = RangeFinder(world.faces, config.lidar)
    ranges = np.array([finder.cast(pose)[0] for pose in poses])
    shares = swept(world, config, poses, finder.bearings_rad, ranges)

    x, y = np.meshgrid(np.arange(1.03, 4.0, 0.1), np.arange(-1.97, 0.0, 0.1))
    points = np.column_stack([x.ravel(), y.ravel()])
    points = points[shapely.contains_xy(ROOM, points[:, 0], points[:, 1])]
    places = points[shapely.distance(ROOM.boundary, shapely.points(points)) >= 0.2]
    can_be_seen = in_sight(points, places, 1.0).any(axis=1)
    seen = np.logical_or.accumulate(in_sight(poses[:, :2], points[can_be_seen], 1.0), axis=0)
    expected = seen.mean(axis=1)

    assert shares == pytest.approx(expected, abs=0.02)
    assert (np.diff(shares) >= 0.0).all()
    assert shares[0] < 0.5 < 0.99 <= shares[-1]
    found = soon(shares, 2.0 * way, way)
    for percent in (90, 99):
        k = found[f"swept_{percent}_steps"] - 1
        assert (found[f"swept_{percent}_s"], found[f"swept_{percent}_m"]) == (2.0 * way[k], way[k])
        assert abs(k - np.argmax(expected >= percent / 100)) <= 2


def test_time_path_and_scans_are_those_of_the_first_scan_that_reaches_a_share():
    time_s, path_m = np.array([0.1, 1.0, 2.5, 2.5]), np.array([0.0, 0.3, 0.4, 0.6])
    found = soon(np.array([0.5, 0.9, 0.95, 0.99]), time_s, path_m)
    assert found == {
        "swept_90_s": 1.0, "swept_90_m": 0.3, "swept_90_steps": 2,
        "swept_99_s": 2.5, "swept_99_m": 0.6, "swept_99_steps": 4,
    }  # fmt: skip
    found = soon(np.array([0.5, 0.89, 0.9, 0.989]), time_s, path_m)
    assert [found[key] for key in SOON] == [2.5, 0.4, 3, None, None, None]
    assert set(soon(np.zeros(4), time_s, path_m).values()) == {None}


def test_where_the_body_does_not_fit_nothing_can_be_seen_or_swept():
    world = World("slit", shapely.box(0.0, 0.0, 5.0, 0.3), np.array([1.0, 0.15, 0.0]), {})
    assert not visible_floor(world, RobotConfig()).any()
    assert swept(world, RobotConfig(), POSE[None], np.linspace(-1.0, 1.0, 9), np.ones((1, 9))) == [0.0]


@pytest.mark.parametrize("pose", [POSE, np.array([3.6, -0.3, 2.0]), np.array([1.2, -1.9, -1.0])])
def test_a_place_is_seen_around_once_no_cell_of_the_square_about_it_is_left(pose):
    floor, reach_m = Floor(ROOM), 0.5
    assert not floor.is_seen_around(pose, reach_m)
    near = np.zeros_like(floor.free)
    for row, column, x, y in cells():
        near[row, column] = abs(x - pose[0]) < reach_m and abs(y - pose[1]) < reach_m
    floor.seen |= near & floor.free
    assert floor.is_seen_around(pose, reach_m)
    row, column = np.argwhere(near & floor.free)[-1]
    floor.seen[row, column] = False
    assert not floor.is_seen_around(pose, reach_m)


def test_a_scan_for_each_pose_or_none():
    room = World("room", shapely.Polygon([(0, 0), (2, 0), (2, 2), (0, 2)]), np.array([1.0, 1.0, 0.0]), {})
    bearings = np.linspace(-np.pi, np.pi, 60, endpoint=False)
    with pytest.raises((ValueError, TypeError)):
        swept(room, RobotConfig(), np.zeros((2, 3)), bearings, np.ones((3, 60)))
    with pytest.raises((ValueError, TypeError)):
        swept(room, RobotConfig(), np.zeros((3, 3)), bearings, np.ones((2, 60)))


def test_beams_that_a_scanner_lost_show_nothing_however_many_are_lost_together():
    """A pillar whose beams are all lost: without a fault they would show the floor behind it."""
    world = World("room", ROOM, POSE, {})
    finder = RangeFinder(world.faces, RobotConfig().lidar)
    ranges = finder.cast(POSE)[0]
    lost = np.where(ranges < 1.2, np.inf, ranges)
    assert 20 < np.count_nonzero(np.isposinf(lost)) < 120
    scores = [
        swept(world, RobotConfig(faults=faults), POSE[None], finder.bearings_rad, each[None])[-1]
        for faults, each in ((FaultsConfig(), lost), (LOSING, lost), (LOSING, np.where(ranges < 1.2, np.nan, ranges)))
    ]
    assert scores[0] > 1.2 * scores[1]
    assert scores[1] == scores[2]
