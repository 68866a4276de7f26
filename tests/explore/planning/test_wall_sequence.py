"""Sequences of walls: each wall is seen from the one before, and what no sequence leads to is told."""

from dataclasses import replace
from itertools import pairwise, permutations
from typing import get_args

import networkx as nx
import numpy as np
import pytest

from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.wall_following import FollowingConfig, Navigation, PlaceErrand
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Planner
from chainslam.explore.planning.wall_sequence import WallSearch
from chainslam.slam.robot import Scan

pytestmark = pytest.mark.usefixtures("_unchecked")

STANDOFF_M, REACH_M = 0.35, 1.0
NOTHING_SEEN = Scan(np.linspace(-3.1, 3.1, 180), np.full(180, np.inf), 0.01, REACH_M, 0.0)


def around_room(scene):
    """Return the graph in which each face leads to the two that it meets, and to no other."""
    joined = [
        (a, b)
        for a, b in permutations(range(len(scene.faces)), 2)
        if np.allclose(scene.faces[a, 1], scene.faces[b, 0]) or np.allclose(scene.faces[a, 0], scene.faces[b, 1])
    ]
    return nx.DiGraph(joined)


def ways(scene, graph, count=30):
    """Return from where to where a way by walls was sought, and the walls, path and planner; None without a way."""
    for start, goal in zip(scene.places[:count], scene.places[40 : 40 + count], strict=True):
        planner = Planner(scene.grid, start, PathConfig())
        found = WallSearch(graph, scene.walls(np.append(start, 0.0)), planner, STANDOFF_M, REACH_M).to(goal[None])
        kept = None if found is None else planner.within(found.cells)
        path = None if kept is None else kept.to(goal[None])
        yield start, goal, None if path is None else (found.walls, path, kept)


@pytest.mark.parametrize("seed", [1, 2])
def test_each_wall_of_a_sequence_is_joined_to_the_one_before_and_the_first_is_in_sight(scene_of, seed):
    scene = scene_of(seed)
    graph, longest = around_room(scene), 0
    for start, _, way in ways(scene, graph):
        if way is None or not way[0]:
            continue
        walls = scene.walls(np.append(start, 0.0))
        assert walls.distances_m[walls.belief.rows([way[0][0]])[0]] <= REACH_M
        assert all(graph.has_edge(a, b) for a, b in pairwise(way[0]))
        longest = max(longest, len(way[0]))
    assert longest >= 2


@pytest.mark.parametrize("seed", [1, 2])
def test_a_way_by_walls_ends_at_the_goal_and_keeps_to_floor_on_which_the_body_fits(scene_of, seed):
    scene = scene_of(seed)
    found = [(start, goal, way) for start, goal, way in ways(scene, around_room(scene)) if way]
    assert len(found) >= 3
    for start, goal, (_, path, kept) in found:
        points = path.points_world
        assert np.hypot(*(points[-1] - goal)) < 0.05
        assert np.hypot(*(points[0] - start)) < 0.05
        assert kept.passable_lines(points[1:], points[1:]).all()
        assert np.all(np.hypot(*np.diff(points, axis=0).T) < 0.08)


@pytest.mark.parametrize("seed", [1, 2])
def test_without_the_graph_the_floor_leads_on_where_walls_do_not(scene_of, seed):
    scene = scene_of(seed)
    by_walls = [way is not None for _, _, way in ways(scene, nx.DiGraph())]
    by_graph = [way is not None for _, _, way in ways(scene, around_room(scene))]
    by_floor = [Planner(scene.grid, a, PathConfig()).to(b[None]) is not None for a, b, _ in ways(scene, nx.DiGraph())]
    assert sum(by_walls) < sum(by_graph) <= sum(by_floor)


@pytest.mark.parametrize("navigation", get_args(Navigation))
def test_an_errand_tells_that_no_sequence_of_walls_leads_there(scene_of, navigation):
    """With no wall in sight and no edge in the graph, only what lies straight ahead can be gone to by walls."""
    scene = scene_of(0)
    config = replace(FollowingConfig(), navigation=navigation)
    start, hidden = next((a, b) for a, b, way in ways(scene, nx.DiGraph()) if way is None)
    errand = PlaceErrand(hidden[None], "there", config)
    command = errand.command(Surroundings(scene.walls(np.append(start, 0.0)), scene.grid, NOTHING_SEEN))
    if navigation == "floor":
        assert command is not None
        assert errand.walls_to_follow == ()
    else:
        assert command is None
        assert errand.trouble == "no sequence of walls leads there"


@pytest.mark.parametrize("seed", [1, 2])
def test_a_planner_that_keeps_to_no_cells_leads_nowhere(scene_of, seed):
    scene = scene_of(seed)
    planner = Planner(scene.grid, scene.places[0], PathConfig())
    goals = next(goal[None] for goal in scene.places[1:] if planner.to(goal[None]) is not None)
    assert planner.within(planner.nowhere).to(goals) is None
    assert planner.to(goals) is not None


@pytest.mark.parametrize("seed", [1, 2])
def test_where_the_goal_lies_straight_ahead_no_wall_is_looked_at(scene_of, seed, monkeypatch):
    scene, looked_at, straight = scene_of(seed), [], 0
    plain = WallSearch._from
    monkeypatch.setattr(
        WallSearch, "_from", lambda self, visit, *rest: looked_at.append(visit) or plain(self, visit, *rest)
    )
    for start, goal in zip(scene.places[:60], scene.places[60:], strict=False):
        planner = Planner(scene.grid, start, PathConfig())
        if not planner.passable_lines(start[None], goal[None])[0]:
            continue
        looked_at.clear()
        search = WallSearch(around_room(scene), scene.walls(np.append(start, 0.0)), planner, STANDOFF_M, REACH_M)
        found = search.to(goal[None])
        assert found is not None
        assert found.walls == ()
        assert len(looked_at) == 1
        straight += 1
    assert straight >= 3
