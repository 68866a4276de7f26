"""Paths over a drawn grid, against a dense Dijkstra and against shapely."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
import shapely
from skimage.graph import MCP_Geometric

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.planning import paths
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Planner
from chainslam.explore.planning.sight import cells_within, sees
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.robot import Scan

CONFIG = PathConfig()
CELL = 0.05
LEAST = CONFIG.robot.radius_m + CONFIG.margin_m


def explored(seed):
    """Return a room of 5 m with random blocks, the grid after scans all over it, and free places."""
    rng = np.random.default_rng(seed)
    drawn = rng.uniform([0, 0, 0.2, 0.2], [4.5, 4.5, 1.2, 1.2], (5, 4))
    blocks = [shapely.box(x, y, x + w, y + h) for x, y, w, h in drawn]
    room = shapely.box(0, 0, 5, 5).difference(shapely.union_all(blocks))
    room = shapely.orient_polygons(max(shapely.get_parts(room), key=lambda part: part.area))
    rings = [shapely.get_coordinates(ring) for ring in (room.exterior, *room.interiors)]
    faces = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    finder, grid = RangeFinder(faces, LidarConfig()), FreeSpace()
    places = rng.uniform(0, 5, (500, 2))
    places = places[shapely.contains_xy(room.buffer(-0.3), places[:, 0], places[:, 1])]
    for place in places[:25]:
        pose = np.append(place, rng.uniform(-3, 3))
        grid.integrate(pose, Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0))
    return room, grid, places


SEEDS = range(5)


def costs_by_definition(grid):
    """Return what a metre through each cell costs: 1 at the stand-off, more nearer to walls, no end below the least."""
    clearance = grid.clearance().astype(float)
    tight = np.clip((CONFIG.standoff_m - clearance) / (CONFIG.standoff_m - LEAST), 0.0, 1.0)
    passable = (grid.evidence < 0) & (clearance >= LEAST)
    return np.where(passable, 1.0 + CONFIG.narrow_cost * tight**2, np.inf)


def dijkstra(costs, start, goal):
    """Return the cheapest cost in cells over the eight neighbours of each cell, or None."""
    graph = nx.Graph()
    rows, columns = np.nonzero(np.isfinite(costs))
    for r, c in zip(rows.tolist(), columns.tolist(), strict=True):
        for dr, dc in ((0, 1), (1, 0), (1, 1), (1, -1)):
            q, k = r + dr, c + dc
            if 0 <= q < costs.shape[0] and 0 <= k < costs.shape[1] and np.isfinite(costs[q, k]):
                graph.add_edge((r, c), (q, k), weight=float(np.hypot(dr, dc) * 0.5 * (costs[r, c] + costs[q, k])))
    if start not in graph or goal not in graph or not nx.has_path(graph, start, goal):
        return None
    return nx.dijkstra_path_length(graph, start, goal)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_path_costs_what_a_dense_dijkstra_says(seed):
    _, grid, places = explored(seed)
    costs = costs_by_definition(grid)
    start = places[0]
    planner = Planner(grid, start, CONFIG)
    compared = 0
    for goal in places[1:4]:
        a, b = (tuple(grid.cells(p[None])[0].tolist()) for p in (start, goal))
        expected, path = dijkstra(costs, a, b), planner.to(goal[None])
        assert (path is None) == (expected is None)
        if path is not None:
            assert path.cost == pytest.approx(expected * CELL, rel=1e-5, abs=1e-6)
            compared += 1
    assert compared


@pytest.mark.parametrize("seed", SEEDS)
def test_a_path_never_crosses_a_wall_and_keeps_the_bodys_clearance(seed):
    room, grid, places = explored(seed)
    planner = Planner(grid, places[0], CONFIG)
    found = 0
    for goal in places[1:12]:
        path = planner.to(goal[None])
        if path is None:
            continue
        found += 1
        way = shapely.LineString(np.repeat(path.points_world, 2, axis=0))
        assert room.contains(way)
        # Cells know walls to half a diagonal at either end.
        assert shapely.distance(way, room.boundary) > LEAST - 1.5 * CELL
        clearance = grid.clearance()[tuple(grid.cells(path.points_world).T)]
        assert np.all(clearance[1:] >= LEAST - 1e-6)
        assert np.all(np.hypot(*np.diff(path.points_world, axis=0).T) < 1.5 * CELL)
        assert np.hypot(*(path.points_world[-1] - goal)) < CELL
    assert found >= 5


@pytest.mark.parametrize("seed", SEEDS)
def test_the_cheapest_of_several_places_is_the_one_reached(seed):
    _, grid, places = explored(seed)
    planner = Planner(grid, places[0], CONFIG)
    single = [planner.to(place[None]) for place in places[1:8]]
    together = planner.to(places[1:8])
    costs = [np.inf if path is None else path.cost for path in single]
    assert together is not None
    assert np.hypot(*(together.points_world[-1] - places[1 + np.argmin(costs)])) < CELL
    assert together.cost == pytest.approx(min(costs))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_window_only_ever_makes_paths_longer(seed):
    _, grid, places = explored(seed)
    whole = Planner(grid, places[0], CONFIG)
    window = Planner(grid, places[0], CONFIG, 1.5)
    for place in places[1:20]:
        inner, outer = window.to(place[None]), whole.to(place[None])
        if np.abs(place - places[0]).max() > 1.5 + CELL:
            assert inner is None
        if inner is not None:
            assert outer is not None
            assert inner.cost >= outer.cost - 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_the_field_of_a_path_is_what_a_way_costs_from_everywhere_around(seed):
    _, grid, places = explored(seed)
    for goal in places[1:8]:
        path = Planner(grid, places[0], CONFIG).to(goal[None])
        if path is None or path.cost < 0.2:
            continue
        cells = np.floor((path.points_world - path.field.corner_world) / CELL).astype(int)[:, ::-1]
        left = path.field.metres[*cells.T, 0]
        assert left[0] == pytest.approx(path.cost)
        assert np.all(np.diff(left) <= 0.0)
        assert left[-1] == 0.0


def test_no_place_and_places_off_the_grid_have_no_path():
    _, grid, places = explored(0)
    planner = Planner(grid, places[0], CONFIG)
    assert planner.to(np.zeros((0, 2))) is None
    assert planner.to(np.array([[500.0, 0.0]])) is None
    assert planner.to(np.array([[-0.3, 2.0]])) is None


def test_a_robot_too_near_to_a_wall_gets_away_from_it():
    _, grid, places = explored(1)
    clearance, cells = grid.clearance(), np.argwhere(grid.evidence < 0)
    near = cells[(clearance[tuple(cells.T)] < LEAST) & (clearance[tuple(cells.T)] >= 0.15)]
    escaped = 0
    for cell in near[:: max(len(near) // 20, 1)]:
        path = Planner(grid, grid.points(cell[None])[0], CONFIG).to(places)
        if path is None:
            continue
        kept = clearance[tuple(grid.cells(path.points_world).T)]
        assert np.all(kept >= kept[0] - 1e-6)
        escaped += 1
    assert escaped >= 10


@pytest.mark.parametrize("seed", SEEDS)
def test_lines_of_sight_agree_with_shapely(seed):
    room, grid, places = explored(seed)
    target, viewers = places[0], places[1:80]
    short = 0.12
    seen = sees(grid, viewers, target, short)
    for viewer, said in zip(viewers, seen, strict=True):
        way = target - viewer
        length = np.hypot(*way)
        line = shapely.LineString([viewer, target - way / length * min(short, length)])
        gap = shapely.distance(line, room.boundary)
        if not room.contains(line) and shapely.length(line.difference(room)) > 2.0 * CELL:
            assert not said
        elif room.contains(line) and gap > 1.5 * CELL:
            assert said
    assert 0 < seen.sum() < len(seen)


def test_a_wall_behind_the_last_bit_of_the_way_does_not_hide_its_own_end():
    room, grid, places = explored(0)
    corner = shapely.get_coordinates(room.exterior)[:1]
    viewers = places[np.hypot(*(places - corner).T) < 1.5]
    if len(viewers):
        assert sees(grid, viewers, corner[0], 3.0).all()


def test_cells_within_reach_are_all_those_within_reach():
    _, grid, places = explored(2)
    found = {tuple(cell) for cell in cells_within(grid, places[0], 0.4).tolist()}
    every = np.argwhere(np.ones(grid.shape, dtype=bool))
    near = every[np.hypot(*(grid.points(every) - places[0]).T) <= 0.4]
    assert found == {tuple(cell) for cell in near.tolist()}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_path_is_sought_only_around_the_shortest_way_by_blocks(seed, monkeypatch):
    _, grid, places = explored(seed)
    searched = []

    def noted(costs):
        searched.append(int(np.count_nonzero(costs > 0)))
        return MCP_Geometric(costs)

    monkeypatch.setattr(paths, "MCP_Geometric", noted)
    planner, floor = Planner(grid, places[0], CONFIG), int(np.count_nonzero(grid.evidence < 0))
    near = places[np.argsort(np.hypot(*(places - places[0]).T))[1:6]]
    assert planner.to(near) is not None
    blocks, cells = searched
    assert blocks < floor / 8
    assert cells < floor / 2


@pytest.mark.parametrize("seed", SEEDS)
def test_what_only_blocks_connect_costs_no_search_of_the_whole_floor(seed, monkeypatch):
    _, grid, places = explored(seed)
    planner, searched = Planner(grid, places[0], CONFIG), []
    column = planner._start[1]
    to_right = planner._passable[:, column + 6 :].sum() > 400
    across = column + 5 if to_right else column - 6
    planner._passable[:, across] = planner._roomy[:, across] = False
    beyond = planner._passable.copy()
    beyond[planner._is_connected] = False
    cells = np.argwhere(beyond)

    def noted(costs):
        searched.append(int(np.count_nonzero(costs > 0)))
        return MCP_Geometric(costs)

    monkeypatch.setattr(paths, "MCP_Geometric", noted)
    assert planner.to(grid.points(cells + planner._corner)) is None
    assert len(searched) == 2
    others = np.argwhere(planner._is_connected)
    assert planner.to(grid.points(others[[-1, 0]] + planner._corner)) is not None


def hall():
    """Return a hall of 16 x 12 m, seen from all over it, and the grid."""
    rings = [shapely.get_coordinates(shapely.orient_polygons(shapely.box(0, 0, 16, 12)).exterior)]
    faces = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    finder, grid = RangeFinder(faces, LidarConfig()), FreeSpace()
    for x in np.arange(1.0, 16.0):
        for y in np.arange(1.0, 12.0):
            pose = np.array([x, y, 0.0])
            grid.integrate(pose, Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0))
    return grid


def from_walls(path):
    x, y = path.points_world.T
    return np.min([x, y, 16.0 - x, 12.0 - y], axis=0)


@pytest.mark.parametrize("window_m", [None, 30.0])
def test_a_path_keeps_walls_in_sight_where_the_detour_is_worth_it(window_m):
    """Across the hall no wall is in sight, and the wheels lose 4 degrees of heading per root metre."""
    grid, start, goal = hall(), np.array([2.0, 6.0]), np.array([8.0, 10.0])
    path = Planner(grid, start, CONFIG, window_m).to(goal[None])
    assert from_walls(path).max() < CONFIG.coast_m + 0.3
    straight = Planner(grid, start, replace(CONFIG, blind_cost=0.0), window_m).to(goal[None])
    assert from_walls(straight).max() > CONFIG.coast_m + 0.3
    assert path.cost < straight.cost + CONFIG.blind_cost * 7.3


@pytest.mark.parametrize("place", [(8.0, 6.0), (9.1, 5.3)])
def test_the_middle_of_a_hall_is_reached_by_the_shortest_stretch_without_walls(place):
    grid, start = hall(), np.array([1.0, 1.0])
    path = Planner(grid, start, CONFIG).to(np.array([place]))
    blind = from_walls(path) > CONFIG.coast_m + 0.2
    step = np.hypot(*np.diff(path.points_world, axis=0).T)
    least = from_walls(path)[-1] - CONFIG.coast_m
    assert np.sum(step[blind[1:]]) < 1.15 * least + 0.2


def test_where_no_wall_was_seen_all_floor_costs_the_same():
    grid = FreeSpace()
    for x in (0.0, 2.0, 4.0):
        grid.integrate(
            np.array([x, 0.0, 0.0]), Scan(np.linspace(-np.pi, np.pi, 181)[:-1], np.full(180, np.inf), 0.01, 4.0, 0.0)
        )
    start, goal = np.array([-1.0, 0.0]), np.array([5.0, 0.0])
    path = Planner(grid, start, CONFIG).to(goal[None])
    assert np.abs(path.points_world[:, 1]).max() < 0.06
