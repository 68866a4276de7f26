"""What moves is told apart from what stands: by returns amid floor that was seen free before."""

from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.floor.return_kernels import amid_free_floor
from chainslam.explore.survey.moving_things import moving_returns
from chainslam.sim.lidar import LidarConfig, RangeFinder, noisy
from chainslam.sim.people import hidden_by
from chainslam.slam.geometry.poses import to_world
from chainslam.slam.robot import Scan, ScannerSpec

pytestmark = pytest.mark.usefixtures("_unchecked")
PERSON_M = 0.2


def scans_along(scene, seed, people, steps=40, pose_sigma_m=0.01):
    """Yield each scan along a walk between places of a room, with its pose; `people` gives where they are at a step."""
    rng = np.random.default_rng(seed)
    finder = RangeFinder(scene.faces, LidarConfig())
    at = rng.integers(30, size=2)
    for step in range(steps):
        place = scene.places[at[0]] + step / steps * (scene.places[at[1]] - scene.places[at[0]])
        if not shapely.contains_xy(scene.room.buffer(-0.25), *place):
            continue
        pose = np.append(place, 0.3)
        ranges = finder.cast(pose)[0]
        ranges = hidden_by(ranges, finder.bearings_rad + pose[2], place, people(step), PERSON_M)
        ranges = noisy(ranges, np.full(180, 0.01), rng.standard_normal(180), 4.0)
        yield (
            step,
            pose + pose_sigma_m * rng.standard_normal(3) * [1, 1, 0.2],
            Scan(finder.bearings_rad, ranges, 0.01, 4.0, 0.0),
        )


def told(scene, seed, people):
    """Return what is said to move at each step, with the step."""
    floor, found = FreeSpace(), []
    for step, pose, scan in scans_along(scene, seed, people):
        floor.integrate(pose, scan)
        found.append((step, moving_returns(scan, floor, scene.walls(pose), ScannerSpec())))
    return found


@pytest.mark.parametrize("seed", range(8))
def test_in_a_building_where_nothing_moves_nothing_is_told(scene_of, seed):
    """With noise of ranges and an error of the pose of a centimetre."""
    found = told(scene_of(seed % 4), seed, lambda _: np.zeros((0, 2)))
    assert sum(len(points) > 0 for _, points in found) == 0


@pytest.mark.parametrize("seed", range(4))
def test_what_stands_unmapped_is_not_told_to_move(scene_of, seed):
    scene = scene_of(seed)
    standing = scene.places[np.random.default_rng(seed).integers(30)]
    found = told(scene, seed + 50, lambda _: standing[None])
    assert sum(len(points) > 0 for _, points in found) <= 1


def test_who_walks_through_floor_seen_free_is_told_where_he_is(scene_of):
    noticed = 0
    for seed in range(4):
        scene = scene_of(seed)
        rng = np.random.default_rng(seed)
        a, b = scene.places[rng.integers(30, size=2)]

        def walker(step, a=a, b=b):
            return (a + (step - 10) / 20 * (b - a))[None] if step >= 10 else np.zeros((0, 2))

        for step, points in told(scene, seed, walker):
            if len(points):
                assert step >= 10
                assert np.hypot(*(points - walker(step)).T).max() < PERSON_M + 0.1
                noticed += 1
    assert noticed >= 10


def test_a_scan_that_hits_nothing_tells_nothing(scene_of):
    scene = scene_of(0)
    scan = Scan(np.linspace(-3.1, 3.1, 180), np.full(180, np.inf), 0.01, 4.0, 0.0)
    pose = np.append(scene.places[0], 0.0)
    assert moving_returns(scan, scene.grid, scene.walls(pose), ScannerSpec()).shape == (0, 2)
    assert to_world(np.zeros((0, 2)), pose).shape == (0, 2)


class Grid:
    """Floor by its evidence alone, in cells of 5 cm from the origin."""

    def __init__(self, evidence):
        self.evidence = evidence

    def cells(self, points_world):
        return np.floor(points_world[:, ::-1] / 0.05).astype(int)


@pytest.mark.parametrize("seed", range(3))
def test_a_return_counts_in_a_free_cell_with_no_occupied_one_beside_it(seed):
    rng = np.random.default_rng(seed)
    grid = Grid(rng.choice([-6, -1, 0, 1, 6], p=[0.5, 0.39, 0.05, 0.03, 0.03], size=(40, 60)))
    points = rng.uniform(-0.2, [3.2, 2.2], (500, 2))
    expected = []
    for row, column in grid.cells(points):
        beside = [grid.evidence[r, c] for r in range(row - 1, row + 2) for c in range(column - 1, column + 2)
                  if 0 <= r < 40 and 0 <= c < 60]  # fmt: skip
        is_inside = 0 <= row < 40 and 0 <= column < 60
        expected.append(is_inside and grid.evidence[row, column] < 0 and max(beside) <= 0)
    found = amid_free_floor(grid.evidence, grid.cells(points))
    assert found.tolist() == expected
    assert 50 < found.sum() < 450


def seen_amid_floor(count, walls=(), tentative=()):
    """Return what of so many neighbouring returns 2 m ahead is told, amid floor seen free and beside some walls."""
    ranges = np.full(180, np.inf)
    ranges[90 : 90 + count] = 2.0
    scan = Scan(np.linspace(-3.1, 3.1, 180), ranges, 0.01, 4.0, 0.0)
    pose = np.array([3.0, 3.0, 0.0])
    ends = np.reshape(np.array([*walls, *tentative], dtype=float), (-1, 2, 2)) + pose[:2]
    is_tentative = np.arange(len(ends)) >= len(walls)
    map_ = SimpleNamespace(ends_world=ends, tentative=is_tentative, belief=SimpleNamespace(pose_world=pose))
    return len(moving_returns(scan, Grid(np.full((120, 140), -6)), map_, ScannerSpec()))


@pytest.mark.parametrize(("count", "told"), [(1, 0), (2, 0), (3, 3), (5, 5)])
def test_single_beams_are_not_told(count, told):
    assert seen_amid_floor(count) == told


def test_what_lies_beside_a_wall_of_the_map_is_the_wall():
    """Within 0.3 m of it; where two returns are left of five, none is."""
    at = {gap: [[2.0 + gap, -1.0], [2.0 + gap, 1.0]] for gap in (0.25, 0.4)}
    assert seen_amid_floor(5, walls=[at[0.25]]) == 0
    assert seen_amid_floor(5, walls=[at[0.4]]) == 5
    assert seen_amid_floor(5, tentative=[at[0.25]]) == 5
    assert [seen_amid_floor(5, walls=[[[2.0, from_m], [2.0, 1.0]]]) for from_m in (0.43, 0.5)] == [0, 3]
