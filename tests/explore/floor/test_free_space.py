"""The grid against slow truths: polygons in shapely, and a full distance transform."""

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.robot import Scan
from tests.explore.floor.plain_clearance import full_clearance

CELL = FreeSpaceConfig().cell_m


def random_room(rng):
    """Return a star-shaped room around the origin, at least 1 m wide everywhere."""
    while True:
        turns = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(4, 9)))
        gaps = np.diff(turns, append=turns[0] + 2 * np.pi)
        if gaps.max() < 2.4 and gaps.min() > 0.3:
            radius = rng.uniform(1.5, 3.5, len(turns))
            return shapely.Polygon(radius[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1))


def faces_of(room):
    points = shapely.get_coordinates(shapely.orient_polygons(room).exterior)
    return np.stack([points[:-1], points[1:]], axis=1)


def scan_from(room, pose, config=None):
    config = config or LidarConfig()
    finder = RangeFinder(faces_of(room), config)
    ranges, _ = finder.cast(pose)
    return Scan(finder.bearings_rad, ranges, config.sigma_m, config.range_max_m, 0.0)


def beam_ends(scan, pose):
    bearing = scan.bearings_rad + pose[2]
    ends = pose[:2] + scan.ranges_m[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    return ends[np.isfinite(scan.ranges_m)]


def places_in(room, rng, count, clearance=0.25):
    inner = room.buffer(-clearance)
    places = rng.uniform(-3, 3, (400, 2))
    places = places[shapely.contains_xy(inner, places[:, 0], places[:, 1])][:count]
    return np.column_stack([places, rng.uniform(-4, 4, len(places))])


@pytest.mark.parametrize("seed", range(6))
def test_floor_seen_free_is_floor_inside_the_room_and_in_sight(seed):
    """One exact scan: a free cell's centre lies in the room and no wall stands between it and the robot."""
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    pose = places_in(room, rng, 1)[0]
    grid = FreeSpace()
    grid.integrate(pose, scan_from(room, pose))
    centres = grid.points(np.argwhere(grid.evidence < 0))
    assert len(centres) > 500
    far = np.hypot(*(centres - pose[:2]).T) > FreeSpaceConfig().body_m
    lines = shapely.linestrings(np.stack([np.broadcast_to(pose[:2], centres[far].shape), centres[far]], axis=1))
    # Between two beams a wall is known only at the beams: a reflex corner may stand in by a little.
    assert np.all(shapely.length(shapely.difference(lines, room)) < 0.5 * CELL)


@pytest.mark.parametrize("seed", range(6))
def test_floor_is_not_free_where_a_beam_ended_and_is_occupied_there(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    grid = FreeSpace()
    for pose in places_in(room, rng, 3):
        scan = scan_from(room, pose)
        grid.integrate(pose, scan)
        cells = grid.cells(beam_ends(scan, pose))
        assert np.all(grid.evidence[tuple(cells.T)] > 0)


@pytest.mark.parametrize("seed", range(6))
def test_floor_before_the_nearer_of_two_neighbouring_beams_is_free(seed):
    """The union of the triangles between neighbouring beams, each as long as the shorter of the two."""
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    pose = places_in(room, rng, 1)[0]
    scan = scan_from(room, pose)
    grid = FreeSpace()
    grid.integrate(pose, scan)
    ranges = np.where(np.isfinite(scan.ranges_m), scan.ranges_m, scan.range_max_m)
    bearing = scan.bearings_rad + pose[2]
    unit = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    short = np.minimum(ranges, np.roll(ranges, -1))[:, None] - 2.0 * CELL
    corners = np.stack([np.zeros((180, 2)), short * unit, short * np.roll(unit, -1, axis=0)], axis=1)
    swept = shapely.union_all(shapely.buffer(shapely.polygons(pose[:2] + corners), 1e-9))
    cells = np.argwhere(np.ones(grid.shape, dtype=bool))
    centres = grid.points(cells)
    inside = shapely.contains_xy(swept, centres[:, 0], centres[:, 1])
    assert inside.sum() > 300
    assert np.all(grid.evidence[tuple(cells[inside].T)] < 0)


@pytest.mark.parametrize("seed", range(6))
def test_floor_beyond_the_walls_or_the_range_stays_unknown(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    config = LidarConfig(range_max_m=2.0)
    pose = places_in(room, rng, 1)[0]
    grid = FreeSpace()
    grid.integrate(pose, scan_from(room, pose, config))
    known = grid.points(np.argwhere(grid.evidence != 0))
    assert np.all(np.hypot(*(known - pose[:2]).T) < 2.0 + CELL)
    assert np.all(shapely.distance(shapely.points(known), room) < CELL)


def test_a_direction_that_was_not_scanned_stays_unknown():
    room = shapely.box(-2, -2, 2, 2)
    full = scan_from(room, np.zeros(3))
    front = np.abs(full.bearings_rad) < 1.5
    half = Scan(full.bearings_rad[front], full.ranges_m[front], full.sigma_m, full.range_max_m, 0.0)
    grid = FreeSpace()
    grid.integrate(np.zeros(3), half)
    known = grid.points(np.argwhere(grid.evidence != 0))
    behind = (np.abs(np.arctan2(known[:, 1], known[:, 0])) > 1.55) & (np.hypot(*known.T) > 0.25)
    assert not behind.any()


def test_beams_without_return_show_free_floor_up_to_the_range_and_nothing_occupied():
    bearings = -np.pi + np.arange(180) * np.deg2rad(2.0)
    grid = FreeSpace()
    grid.integrate(np.zeros(3), Scan(bearings, np.full(180, np.inf), 0.01, 1.5, 0.0))
    assert np.all(grid.evidence <= 0)
    centres = grid.points(np.argwhere(np.ones(grid.shape, dtype=bool))).reshape(*grid.shape, 2)
    distance = np.hypot(centres[..., 0], centres[..., 1])
    assert np.all(grid.evidence[distance < 1.5 - CELL] < 0)
    assert np.all(grid.evidence[distance > 1.5] == 0)


@pytest.mark.parametrize("seed", range(4))
def test_clearances_equal_a_full_distance_transform_after_many_updates(seed):
    """Cells are hit, freed again, hit elsewhere, and touched."""
    rng = np.random.default_rng(seed)
    grid, bearings = FreeSpace(), -np.pi + np.arange(90) * np.deg2rad(4.0)
    for _ in range(60):
        pose = rng.uniform([-0.4, -0.4, -4.0], [0.4, 0.4, 4.0])
        ranges = np.where(rng.random(90) < 0.2, np.inf, rng.uniform(0.25, 1.5, 90))
        grid.integrate(pose, Scan(bearings, ranges, 0.01, 1.6, 0.0))
        if rng.random() < 0.4:
            np.testing.assert_allclose(grid.clearance(), full_clearance(grid), atol=1e-6)
        if rng.random() < 0.1:
            grid.note_touched(rng.uniform(-1.0, 1.0, 2))
            np.testing.assert_allclose(grid.clearance(), full_clearance(grid), atol=1e-6)
    np.testing.assert_allclose(grid.clearance(), full_clearance(grid), atol=1e-6)


def test_growing_keeps_what_is_known_where_it_is():
    rng = np.random.default_rng(9)
    room = random_room(rng)
    pose = places_in(room, rng, 1)[0]
    grid = FreeSpace()
    grid.integrate(pose, scan_from(room, pose))
    cells = np.argwhere(grid.evidence != 0)
    centres, known = grid.points(cells), grid.evidence[tuple(cells.T)].copy()
    bearings = -np.pi + np.arange(90) * np.deg2rad(4.0)
    for x, y in ((30.0, 0.0), (-30.0, -25.0), (0.0, 40.0)):
        grid.integrate(np.array([x, y, 0.0]), Scan(bearings, np.full(90, 1.0), 0.01, 1.6, 0.0))
    np.testing.assert_array_equal(grid.evidence[tuple(grid.cells(centres).T)], known)


def test_cells_and_points_are_each_others_inverse():
    grid = FreeSpace()
    grid.integrate(np.array([-3.0, 7.0, 0.0]), scan_from(shapely.box(-5, 5, 0, 9), np.array([-3.0, 7.0, 0.0])))
    cells = np.argwhere(np.ones(grid.shape, dtype=bool))
    np.testing.assert_array_equal(grid.cells(grid.points(cells)), cells)
    rng = np.random.default_rng(1)
    points = rng.uniform([-5, 5], [0, 9], (50, 2))
    assert np.all(np.abs(grid.points(grid.cells(points)) - points) <= 0.5 * CELL + 1e-9)
    assert np.all(grid.inside(cells))
    assert not grid.inside(np.array([[-1, 0]]))[0]


def test_evidence_against_a_wall_frees_it_and_evidence_for_it_brings_it_back():
    near, far = shapely.box(-1, -1, 1, 1), shapely.box(-2, -2, 2, 2)
    grid = FreeSpace()
    config = grid.config
    pose = np.array([0.012, 0.013, 0.0])
    at = np.array([[1.0 + 0.4 * CELL, 0.01]])

    def evidence():
        return int(grid.evidence[tuple(grid.cells(at)[0])])

    for _ in range(10):
        grid.integrate(pose, scan_from(near.buffer(0.4 * CELL, join_style="mitre"), pose))
    assert evidence() == config.limit
    for _ in range(2 * config.limit):
        grid.integrate(pose, scan_from(far, pose))
    assert evidence() == -config.limit


def test_unseen_floor_is_unknown_also_beyond_the_grid():
    grid = FreeSpace()
    assert grid.unknown_at(np.zeros((2, 2))).all()
    grid.integrate(np.zeros(3), scan_from(shapely.box(-1, -1, 1, 1), np.zeros(3)))
    np.testing.assert_array_equal(
        grid.unknown_at(np.array([[0.5, 0.5], [1.6, 0.0], [500.0, 0.0]])), [False, True, True]
    )
