"""Driving distances from one search over blocks, against the paths of the planner."""

import numpy as np
import pytest
import shapely
from skimage.graph import MCP_Geometric

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.planning import driving_field
from chainslam.explore.planning.driving_field import DrivingField
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Planner
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.robot import Scan

LENGTH = PathConfig(narrow_cost=0.0)
SEEDS = range(4)


def seen(seed, looks=25):
    """Return the grid of a room of 6 m divided by walls with gaps, some too narrow, and free places."""
    rng = np.random.default_rng(seed)
    walls = []
    for at in (1.9, 3.9):
        gap, width = rng.uniform(0.5, 4.5), rng.choice([0.3, 0.6, 1.0])
        walls += [shapely.box(at, 0, at + 0.1, gap), shapely.box(at, gap + width, at + 0.1, 6)]
    room = shapely.box(0, 0, 6, 6).difference(shapely.union_all(walls))
    faces = []
    for part in shapely.get_parts(shapely.orient_polygons(room)):
        for ring in (part.exterior, *part.interiors):
            points = shapely.get_coordinates(ring)
            faces.append(np.stack([points[:-1], points[1:]], axis=1))
    finder, grid = RangeFinder(np.concatenate(faces), LidarConfig()), FreeSpace()
    places = rng.uniform(0, 6, (500, 2))
    places = places[shapely.contains_xy(room.buffer(-0.3), places[:, 0], places[:, 1])]
    for place in places[:looks]:
        pose = np.append(place, rng.uniform(-3, 3))
        grid.integrate(pose, Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0))
    return grid, places


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_are_those_of_the_shortest_paths_to_within_two_blocks(seed):
    grid, places = seen(seed)
    field, planner = DrivingField(grid, places[0], LENGTH), Planner(grid, places[0], LENGTH)
    metres, out_of_reach = field.metres(places), 0
    for place, said in zip(places[1:40], metres[1:80], strict=False):
        path = planner.to(place[None])
        assert (path is not None) == np.isfinite(said)
        if path is None:
            out_of_reach += 1
        else:
            assert said == pytest.approx(path.cost, abs=0.4)
    assert np.isfinite(metres).any()


@pytest.mark.parametrize("seed", SEEDS)
def test_reachable_cells_are_those_with_a_path(seed):
    grid, places = seen(seed, 12)
    field, planner = DrivingField(grid, places[0], LENGTH), Planner(grid, places[0], LENGTH)
    every = np.argwhere(np.ones(grid.shape, dtype=bool))
    cells, others = every[field.can_stay(every)], every[~field.can_stay(every)]
    assert len(cells) > 200
    rng = np.random.default_rng(seed)
    for cell in cells[rng.integers(0, len(cells), 30)]:
        assert planner.to(grid.points(cell[None])) is not None
    for cell in others[rng.integers(0, len(others), 30)]:
        if np.hypot(*(grid.points(cell[None])[0] - places[0])) > LENGTH.escape_m + 0.1:
            assert planner.to(grid.points(cell[None])) is None


def test_places_off_the_grid_and_behind_walls_are_infinitely_far():
    grid, places = seen(0)
    field = DrivingField(grid, places[0], LENGTH)
    assert np.all(np.isinf(field.metres(np.array([[500.0, 0.0], [-500.0, 3.0], [3.0, -40.0]]))))


def test_a_robot_too_near_to_a_wall_still_knows_its_way():
    grid, places = seen(1)
    near = np.argwhere((grid.evidence < 0) & (grid.clearance() < 0.2) & (grid.clearance() > 0.15))
    for cell in near[:: max(len(near) // 20, 1)]:
        assert np.isfinite(DrivingField(grid, grid.points(cell[None])[0], LENGTH).metres(places)).any()


def test_what_is_near_is_found_without_a_search_of_the_whole_building(monkeypatch):
    grid, searched = FreeSpace(), []
    beams = np.linspace(-np.pi, np.pi, 180, endpoint=False)
    for x in np.arange(0.0, 40.0, 1.0):
        grid.integrate(np.array([x, 0.0, 0.0]), Scan(beams, np.full(180, np.inf), 0.01, 4.0, 0.0))

    def noted(blocks):
        searched.append(blocks.shape)
        return MCP_Geometric(blocks)

    monkeypatch.setattr(driving_field, "MCP_Geometric", noted)
    places = np.array([[22.0, 1.0], [23.0, 0.0], [39.0, 0.0]])
    nearest = DrivingField(grid, np.array([20.0, 0.0]), LENGTH)
    near = nearest.metres(places, beyond_nearest=False)
    assert [max(shape) < 100 for shape in searched] == [True]
    every = DrivingField(grid, np.array([20.0, 0.0]), LENGTH).metres(places)
    assert np.argmin(near) == np.argmin(every) == 0
    assert near[0] == every[0]
    assert np.all(near >= every)
    assert max(searched[-1]) > 150
    assert nearest.metres(places).tolist() == every.tolist()
