"""A gap too narrow for the body is found with its width and the floor behind it; a door wide enough is none."""

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.survey.narrow_gaps import narrow_gaps
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.robot import Scan

ROOMS = [shapely.box(0, 0, 3, 3), shapely.box(3.1, 0, 6, 3)]
ROBOT = np.array([1.5, 1.5])


def seen(width_m):
    """Return the floor of two rooms with a gap between them, as scans along the middle of both see it."""
    door = shapely.box(2.9, 1.5 - width_m / 2, 3.2, 1.5 + width_m / 2)
    floor = shapely.orient_polygons(shapely.union_all([*ROOMS, door]))
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(floor))]
    faces = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    finder, space = RangeFinder(faces, LidarConfig(360)), FreeSpace(FreeSpaceConfig())
    for x in (1.0, 1.5, 2.0, 4.5):
        pose = np.array([x, 1.5, 0.0])
        space.integrate(pose, Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0))
    return space


@pytest.mark.parametrize("width_m", [0.2, 0.25, 0.3])
def test_the_gap_is_where_it_is_as_wide_as_it_is_and_hides_the_room_behind(width_m):
    (gap,) = narrow_gaps(seen(width_m), ROBOT, PathConfig())
    assert gap.width_m == pytest.approx(width_m, abs=0.06)
    np.testing.assert_allclose(gap.position_world, [3.05, 1.5], atol=0.15)
    assert gap.beyond_m2 == pytest.approx(ROOMS[1].area, rel=0.2)
    assert f"{gap.body_m:.2f} m" in gap.why


@pytest.mark.parametrize("width_m", [0.0, 0.05, 0.6])
def test_a_door_wide_enough_is_no_gap_nor_is_a_crack(width_m):
    assert narrow_gaps(seen(width_m), ROBOT, PathConfig()) == ()


def test_on_floor_never_seen_there_is_none():
    assert narrow_gaps(FreeSpace(FreeSpaceConfig()), ROBOT, PathConfig()) == ()
