"""Routes over walls: shortest, the same every time, and the paper's figure 4."""

from functools import cache
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
import shapely

from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.mission import MissionConfig, explore_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.planning.visibility_graph import NEIGHBOUR, SIGHT
from chainslam.explore.planning.wall_routes import sequence
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.backends import BACKENDS
from chainslam.slam.geometry.lines import normals
from chainslam.slam.mapper import Mapper

STAND_OFF_M, RANGE_M, PITCH_M, BODY_M = 0.35, 4.0, 0.05, 0.2


def test_the_route_is_by_the_fewest_changes_of_wall():
    graph = nx.DiGraph([(1, 2), (2, 3), (3, 9), (1, 5), (5, 9), (9, 1)])
    assert sequence(graph, (1,), 9) == (1, 5, 9)
    assert sequence(graph, (9,), 3) == (9, 1, 2, 3)


def test_a_sight_is_never_taken_backwards():
    graph = nx.DiGraph([(1, 2), (2, 3)])
    assert sequence(graph, (1,), 3) == (1, 2, 3)
    assert sequence(graph, (3,), 1) == ()


def test_without_a_way_there_is_no_wall():
    graph = nx.DiGraph([(1, 2), (2, 9)])
    assert sequence(graph, (), 9) == sequence(graph, (77,), 9) == sequence(graph, (1,), 88) == ()
    assert sequence(graph, (9,), 9) == (9,)


@pytest.mark.parametrize("seed", range(20))
def test_among_equals_neighbours_come_first_then_the_lowest_ids_whatever_was_entered_first(seed):
    rng = np.random.default_rng(seed)
    pairs = dict.fromkeys((int(a), int(b)) for a, b in rng.integers(0, 14, (40, 2)) if a != b)
    edges = [(a, b, {"kind": (SIGHT, NEIGHBOUR)[rng.integers(2)]}) for a, b in pairs]
    orders = [edges, edges[::-1], [edges[k] for k in rng.permutation(len(edges))]]
    graphs = [nx.DiGraph(order) for order in orders]

    def sights(walls):
        return sum(graphs[0].edges[edge]["kind"] == SIGHT for edge in pairwise(walls))

    for goal in range(1, 14):
        if goal not in graphs[0] or 0 not in graphs[0] or not nx.has_path(graphs[0], 0, goal):
            continue
        best = min(nx.all_shortest_paths(graphs[0], 0, goal), key=lambda walls: (sights(walls), walls))
        assert {sequence(graph, (0,), goal) for graph in graphs} == {tuple(best)}


def along(face, offset_m):
    """Return points along a face, moved to its free side."""
    way = face[1] - face[0]
    length = np.hypot(*way)
    count = int(np.ceil(length / PITCH_M))
    share = (np.arange(count) + 0.5) / count
    return face[0] + share[:, None] * way + offset_m * np.array([-way[1], way[0]]) / length


@cache
def figure_4():
    """Return the world and its faces by number."""
    world = load("paper-fig4")
    middles = world.faces.mean(axis=1)
    numbered = {int(k): int(np.argmin(np.hypot(*(middles - at).T))) for k, at in world.labels.items()}
    return world, {number: world.faces[row] for number, row in numbered.items()}


def is_seen(world, viewer, wall):
    """Whether some place along one face at the stand-off sees some point of another within range: brute force."""
    places = along(viewer, STAND_OFF_M)
    places = places[shapely.contains(world.free.buffer(-BODY_M), shapely.points(places))]
    points = along(wall, 1e-6)
    pairs = np.stack(np.broadcast_arrays(places[:, None], points[None]), axis=2).reshape(-1, 2, 2)
    pairs = pairs[np.hypot(*(pairs[:, 1] - pairs[:, 0]).T) <= RANGE_M]
    return bool(len(pairs)) and bool(np.any(shapely.contains_properly(world.free, shapely.linestrings(pairs))))


def test_from_wall_8_to_wall_16_the_route_is_the_papers():
    world, faces = figure_4()
    shapely.prepare(world.free)
    graph = nx.DiGraph()
    for a, one in faces.items():
        for b, other in faces.items():
            if a != b and (np.allclose(one[1], other[0]) or np.allclose(one[0], other[1])):
                graph.add_edge(a, b, kind=NEIGHBOUR)
            elif a != b and is_seen(world, one, other):
                graph.add_edge(a, b, kind=SIGHT)
    assert sequence(graph, (8,), 16) == (8, 3, 12, 15, 16)
    assert len(sequence(graph, (8,), 16)) == nx.shortest_path_length(graph, 8, 16) + 1
    for a, b in pairwise((2, 6, 8, 10)):
        assert graph.edges[a, b]["kind"] == graph.edges[b, a]["kind"] == NEIGHBOUR


def numbers_of(walls, faces):
    """Return the number of the face that each mapped wall lies on; errorless, so within centimetres."""
    found = {}
    for wall, ends, mean in zip(walls.ids, walls.ends_world, walls.belief.means, strict=True):
        for number, face in faces.items():
            way = face[1] - face[0]
            n = np.array([way[1], -way[0]]) / np.hypot(*way)
            on_line = np.abs((ends - face[0]) @ n).max() < 0.05 and normals(mean[:1])[0] @ n > 0.98
            share = (ends.mean(axis=0) - face[0]) @ way / (way @ way)
            if on_line and 0 < share < 1:
                found[int(wall)] = number
    return found


def test_the_robots_own_graph_of_figure_4_leads_from_wall_8_to_wall_16():
    world, faces = figure_4()
    robot = SimulatedRobot(world, 1, errorless=True)
    backend = BACKENDS["full-ekf"].make(world.start.copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    *_, last = explore_mission(robot, Mapper(backend), STRATEGIES["nearest-robot"].make())
    assert last.ended == "complete"
    number = numbers_of(last.map, faces)
    ids = {n: wall for wall, n in number.items()}
    assert set(ids) == set(faces)
    assert len(number) == len(ids) == len(last.map)
    walls = sequence(last.graph, (ids[8],), ids[16])
    assert [number[wall] for wall in walls] == [8, 3, 12, 15, 16]
    for a, b in pairwise(walls):
        kind = last.graph.edges[a, b]["kind"]
        if kind == NEIGHBOUR:
            assert last.graph.has_edge(b, a)
    for a, b in pairwise((2, 6, 8, 10)):
        assert last.graph.edges[ids[a], ids[b]]["kind"] == last.graph.edges[ids[b], ids[a]]["kind"] == NEIGHBOUR


def test_by_sequences_of_walls_the_robot_explores_figure_4():
    """It goes straight to what is ahead and along walls to what is not."""
    world, _ = figure_4()
    robot = SimulatedRobot(world, 1, errorless=True)
    backend = BACKENDS["full-ekf"].make(world.start.copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    config = MissionConfig(explorer=ExplorerConfig(following=FollowingConfig(navigation="visibility")))
    *steps, last = explore_mission(robot, Mapper(backend), STRATEGIES["nearest-start"].make(), config)
    assert last.outcome is Outcome.ALL_CLOSED
    assert robot.record.collisions == 0
    led = [step.decision.walls_to_follow for step in steps if step.decision.walls_to_follow]
    assert led
