"""Sequences of walls over the visibility graph: the fewest changes of wall, held against breadth-first search."""

import networkx as nx
import numpy as np

from chainslam.explore.planning.wall_routes import sequence


def random_graphs(seed, count=60):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        graph = nx.DiGraph(nx.gnp_random_graph(12, 0.15, seed=int(rng.integers(1 << 30)), directed=True))
        yield rng, graph


def layers(graph, near):
    """Return the fewest edges to each wall from any of some walls, by breadth-first search."""
    found, front, depth = dict.fromkeys(near, 0), list(near), 0
    while front:
        depth += 1
        front = [b for a in front for b in graph.successors(a) if b not in found and not found.update({b: depth})]
    return found


def test_a_sequence_begins_near_ends_at_the_goal_and_takes_the_fewest_edges():
    reached = 0
    for rng, graph in random_graphs(1):
        near, goal = rng.choice(12, 3, replace=False).tolist(), int(rng.integers(12))
        walls, least = sequence(graph, near, goal), layers(graph, near)
        if goal not in least:
            assert walls == ()
            continue
        reached += len(walls) > 2
        assert walls[0] in near
        assert walls[-1] == goal
        assert len(walls) == least[goal] + 1
        assert nx.is_path(graph, walls)
    assert reached > 10


def test_closed_edges_are_not_taken():
    for rng, graph in random_graphs(2):
        edges = list(graph.edges)
        closed = {edges[k] for k in rng.choice(len(edges), len(edges) // 3, replace=False)}
        rest = nx.DiGraph()
        rest.add_nodes_from(graph)
        rest.add_edges_from(set(edges) - closed)
        near, goal = [int(rng.integers(12))], int(rng.integers(12))
        assert len(sequence(graph, near, goal, closed)) == len(sequence(rest, near, goal))


def test_walls_that_the_graph_does_not_know_lead_nowhere_but_to_themselves():
    graph = nx.DiGraph([(1, 2)])
    assert sequence(graph, [7], 7) == (7,)
    assert sequence(graph, [7], 2) == ()
    assert sequence(graph, [1], 7) == ()
