"""What moves is told apart from what stands: by returns amid floor that was seen free before."""

import numpy as np
import pytest
import shapely

from explore.floor.free_space import FreeSpace
from explore.survey.moving_things import moving_returns
from sim.lidar import LidarConfig, RangeFinder, noisy
from sim.people import hidden_by
from slam.geometry.poses import to_world
from slam.robot import Scan, ScannerSpec

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
