"""The drawing of a visibility graph: where circles and edges lie, over random walls, and what the page says."""

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.explore.planning.visibility_graph import NEIGHBOUR, SIGHT
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.map.chains import Chain, OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.viz.figures.graph_shapes import CLEAR, beside_m, free_normals, nodes_of
from chainslam.viz.figures.maps import png
from chainslam.viz.figures.visibility import GraphPicture, draw_graph

few = settings(max_examples=25, deadline=None, derandomize=True)
IDS = np.array([3, 5, 8, 120])


def room(route=()):
    """A room of four walls whose last corner is open, with a sight one way, one both ways, and a tentative fifth id."""
    alpha = np.array([-np.pi / 2, 0.0, np.pi / 2, np.pi])
    anchors = 2.0 * np.array([[1.0, 0.0], [2.0, 1.0], [1.0, 2.0], [0.0, 1.0]])
    belief = Belief(
        np.array([1.0, 1.0, 0.0]), 1e-4 * np.eye(3), IDS, anchors, np.stack([alpha, np.zeros(4)], axis=-1),
        lambda ids: Joint(np.zeros(3), np.eye(3), np.zeros((0, 2))),
    )  # fmt: skip
    nothing = np.zeros(4, dtype=bool)
    walls = StochasticMap(belief, np.tile([-2.0, 2.0], (4, 1)), np.full(4, 3), nothing, nothing)
    corners = np.array([[4.0, 0.0], [4.0, 4.0], [0.0, 4.0]])
    chain = Chain((3, 5, 8, 120), corners, (OpenEnd(3, 0, np.zeros(2)), OpenEnd(120, 1, np.zeros(2))))
    graph = nx.DiGraph([(3, 8), (8, 3), (120, 5)], kind=SIGHT)
    graph.add_edges_from([(3, 8), (8, 3), (120, 5)], kind=SIGHT)
    for a, b in ((3, 5), (5, 8), (8, 120)):
        graph.add_edge(a, b, kind=NEIGHBOUR)
        graph.add_edge(b, a, kind=NEIGHBOUR)
    return GraphPicture(walls, (chain,), graph, "a room", route=route, names={8: "eight"})


def drawn(figure):
    """Numbers in the circles, words of the legend, and how many lines there are of each width."""
    (axes,) = figure.axes
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    lines = [c for c in axes.collections if type(c).__name__ == "LineCollection"]
    return [text.get_text() for text in axes.texts], legend, [len(c.get_segments()) for c in lines]


def test_every_wall_has_its_number_and_every_pair_one_edge():
    names, legend, edges = drawn(draw_graph(room()))
    assert names == ["3", "5", "eight", "120", "1 m"]  # the last is that of the scale bar
    assert legend == ["seen from there (two heads: both ways)", "neighbours in a chain"]
    walls, sights, neighbours = edges
    assert (walls, sights, neighbours) == (4, 2, 3)  # two heads on one of the sights


def test_a_route_is_drawn_over_the_edges_that_it_takes():
    _, legend, edges = drawn(draw_graph(room(route=(120, 5, 3))))
    assert legend[-1] == "planned route"
    assert edges[-1] == 2
    assert png(draw_graph(room(route=(120, 5)))) == png(draw_graph(room(route=(120, 5))))


@few
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 40), radius=st.floats(0.02, 0.3))
def test_circles_stand_apart_on_the_free_side_and_sights_end_before_them(seed, count, radius):
    rng = np.random.default_rng(seed)
    begin = rng.uniform(0.0, 2.0 * np.sqrt(count), (count, 2))
    ends = np.stack([begin, begin + rng.normal(0.0, 2.0, (count, 2))], axis=1)
    nodes = nodes_of(ends, radius)
    middles = ends.mean(axis=1)
    pairs = np.array(list(combinations(range(count), 2)))
    apart = np.hypot(*(middles[pairs[:, 0]] - middles[pairs[:, 1]]).T)
    if apart.min() > 6.0 * radius:  # nothing had to move
        np.testing.assert_allclose(np.sum((nodes.at - middles) * free_normals(ends), axis=1), beside_m(radius))
    else:
        gaps = np.hypot(*(nodes.at[pairs[:, 0]] - nodes.at[pairs[:, 1]]).T)
        assert np.mean(gaps > 1.9 * radius) > 0.95
    for (a, b), curve in zip(pairs, nodes.sights(pairs), strict=True):
        metres = np.hypot(*(nodes.at[a] - nodes.at[b]))
        for node, tip in ((a, curve[0]), (b, curve[-1])):
            clear = np.hypot(*(nodes.at[node] - tip))
            assert clear == pytest.approx(min(CLEAR * radius, 0.45 * metres), rel=0.05, abs=1e-6)


@few
@given(turn=st.floats(-2.5, 2.5), length=st.floats(2.0, 9.0), radius=st.floats(0.05, 0.2))
def test_a_line_between_neighbours_goes_round_their_corner_on_the_free_side(turn, length, radius):
    ahead = np.array([np.cos(turn), np.sin(turn)])
    ends = np.array([[[-length, 0.0], [0.0, 0.0]], [[0.0, 0.0], length * ahead]])
    way = nodes_of(ends, radius).round_corner(0, 1)
    walls = shapely.MultiLineString(list(ends))
    assert not shapely.LineString(way).intersects(walls)
    assert shapely.distance(shapely.points(way), walls).min() > 0.2 * radius
    for end, normal, tip in zip(ends, free_normals(ends), (way[0], way[-1]), strict=True):
        assert (tip - end[0]) @ normal > 0.2 * radius
