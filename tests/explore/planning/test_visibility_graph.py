"""The visibility graph: neighbours both ways, sights one way, and nodes that follow the map."""

import numpy as np
import pytest

from chainslam.explore.planning.visibility_graph import NEIGHBOUR, SIGHT, VisibilityGraph, followed_wall, neighbours
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.chains import Chain, OpenEnd, connect
from chainslam.slam.map.stochastic_map import StochasticMap


def map_of(segments, pose=(0.0, 0.0, 0.0), ids=None, tentative=()):
    """Return a map whose walls are these segments (free side on the left)."""
    segments = np.asarray(segments, dtype=float)
    count = len(segments)
    lines, anchors = through(segments), segments.mean(axis=1)
    d = lines[:, 1] - np.sum(normals(lines[:, 0]) * anchors, axis=-1)
    half = 0.5 * np.hypot(*(segments[:, 1] - segments[:, 0]).T)
    mean = np.zeros(3 + 2 * count)

    def query(wanted):
        return Joint(mean, np.eye(len(mean)), anchors)

    numbers = np.arange(count) if ids is None else np.asarray(ids)
    belief = Belief(np.array(pose), np.eye(3), numbers, anchors, np.stack([lines[:, 0], d], axis=-1), query)
    marks = np.isin(numbers, tentative)
    return StochasticMap(
        belief, np.stack([-half, half], axis=-1), np.full(count, 5), marks, np.zeros(count, dtype=bool)
    )


def square(side=4.0):
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side]])
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def edges(graph, kind):
    return {(a, b) for a, b, data in graph.edges(data=True) if data["kind"] == kind}


def test_neighbours_are_joined_both_ways_all_round_a_closed_chain():
    walls = map_of(square())
    graph = VisibilityGraph()
    graph.observe(walls, connect(walls), None, [])
    assert edges(graph.graph, NEIGHBOUR) == {(a, (a + s) % 4) for a in range(4) for s in (1, 3)}
    assert edges(graph.graph, SIGHT) == set()


def test_an_open_chain_does_not_join_its_two_ends():
    walls = map_of(square()[:3])
    graph = VisibilityGraph()
    graph.observe(walls, connect(walls), None, [])
    assert edges(graph.graph, NEIGHBOUR) == {(0, 1), (1, 0), (1, 2), (2, 1)}


def test_a_sight_holds_in_one_direction_and_for_good():
    walls = map_of(square(), ids=[3, 5, 8, 9])
    graph = VisibilityGraph()
    graph.observe(walls, (), 3, [3, 8])
    assert edges(graph.graph, SIGHT) == {(3, 8)}
    graph.observe(walls, (), 5, [9])
    graph.observe(walls, (), None, [5])
    assert edges(graph.graph, SIGHT) == {(3, 8), (5, 9)}


def test_nodes_are_the_trusted_walls_of_the_map():
    graph = VisibilityGraph()
    graph.observe(map_of(square(), tentative=[2]), (), 0, [1, 2])
    assert set(graph.graph) == {0, 1, 3}
    assert edges(graph.graph, SIGHT) == {(0, 1)}
    graph.observe(map_of(square()[:2], ids=[1, 7]), (), 7, [1])
    assert set(graph.graph) == {1, 7}
    assert edges(graph.graph, SIGHT) == {(7, 1)}


def test_walls_that_no_longer_meet_are_no_neighbours_but_what_was_seen_stays():
    walls = map_of(square())
    graph = VisibilityGraph()
    graph.observe(walls, connect(walls), 0, [2])
    graph.observe(walls, (), None, [])
    assert edges(graph.graph, NEIGHBOUR) == set()
    assert edges(graph.graph, SIGHT) == {(0, 2)}


def test_a_tentative_wall_is_not_followed_and_sees_nothing():
    walls = map_of(square(), pose=(2.0, 0.3, 0.0), tentative=[0])
    assert followed_wall(walls, reach_m=1.0) is None
    graph = VisibilityGraph()
    graph.observe(walls, (), 0, [1, 2])
    assert edges(graph.graph, SIGHT) == set()


@pytest.mark.parametrize(("closed", "expected"), [(True, [(4, 7), (7, 9), (9, 4)]), (False, [(4, 7), (7, 9)])])
def test_the_neighbours_of_a_chain_are_its_pairs_in_order(closed, expected):
    ends = () if closed else (OpenEnd(4, 0, np.zeros(2)), OpenEnd(9, 1, np.zeros(2)))
    assert neighbours(Chain((4, 7, 9), np.zeros((len(expected), 2)), ends)) == expected


def test_a_chain_of_one_wall_has_no_neighbours():
    assert neighbours(Chain((4,), np.zeros((0, 2)), ())) == []


def test_the_wall_followed_is_the_nearest_whose_free_side_the_robot_is_on():
    """Brute force over random places: the face of a thin wall seen from behind is never it."""
    thin = np.array([[[0, 0], [4, 0]], [[4, -0.1], [0, -0.1]], [[4, 3], [0, 3]]], dtype=float)
    rng = np.random.default_rng(2)
    for x, y in rng.uniform([-1, -2], [5, 4], (200, 2)):
        found = followed_wall(map_of(thin, pose=(x, y, 0.0)), reach_m=1.0)
        gaps = {}
        for wall, (low, side) in enumerate([(0.0, 1.0), (-0.1, -1.0), (3.0, -1.0)]):
            if side * (y - low) >= 0:
                gaps[wall] = np.hypot(max(-x, x - 4.0, 0.0), y - low)
        nearest = min(gaps, key=gaps.get, default=None)
        assert found == (nearest if nearest is not None and gaps[nearest] <= 1.0 else None)


def test_round_an_outer_corner_the_wall_that_is_wanted_counts():
    corner = np.array([[[0, 4], [0, 0]], [[0, 0], [4, 0]]], dtype=float)[:, ::-1]
    walls = map_of(corner, pose=(-0.3, -0.2, 0.0))
    assert [followed_wall(walls, rather=(wall,)) for wall in (0, 1)] == [0, 1]
    beside = map_of(corner, pose=(1.0, -0.2, 0.0))
    assert [followed_wall(beside, rather=(wall,)) for wall in (0, 1)] == [1, 1]
