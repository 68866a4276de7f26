"""A map with its partial visibility graph, in the style of the paper's figure 4: walls as numbered circles."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from textwrap import wrap

import networkx as nx
import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PatchCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from chainslam.explore.planning.visibility_graph import NEIGHBOUR, neighbours
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from .. import palette
from ..text import literal
from . import own_look
from .graph_shapes import Nodes, heads, nodes_of
from .map_axes import scale_bar

MARGIN_M = 0.5
RADIUS_POINTS = 7.5
"""Radius of a node's circle ..."""
LEAST_POINTS = 3.2
"""... and in a map of hundreds of walls."""
HEAD_POINTS = 5.5
LONGER_INCH = 8.5
"""Longer side of the map in the picture; that of a large map is larger, to have room for its circles."""
LARGEST_INCH = 20.0
EDGE_INCH = 0.15
LETTER_INCH = 0.072
"""Mean width of a character of the subtitle."""
WALLS = 60
"""A map with more walls is a large one."""


@dataclass(frozen=True)
class GraphPicture:
    """A map and its graph, in one world frame."""

    map: StochasticMap
    chains: tuple[Chain, ...]
    graph: "nx.DiGraph[int]"
    """Nodes are ids of walls; an edge's `kind` says whether two walls are neighbours or one was seen from the other."""
    title: str
    subtitle: str = ""
    names: Mapping[int, str] = field(default_factory=dict)
    """Labels of walls, where they are not the ids."""
    route: tuple[int, ...] = ()
    """Ids of the walls to follow, in order, drawn with wide lines."""
    true_floor: tuple[Float[np.ndarray, "_ 2"], ...] = ()
    """Rings of the true floor, the exterior first; empty without ground truth."""


@dataclass(frozen=True)
class _Edges:
    """Edges of a graph, as rows of the drawn walls."""

    neighbours: Int[np.ndarray, "n 2"]
    """Each pair once; the second follows the first in its chain."""
    mutual: Int[np.ndarray, "m 2"]
    """Pairs that were seen from each other."""
    single: Int[np.ndarray, "s 2"]
    """The second was seen from the first, but not the first from the second."""


@own_look()
def draw_graph(picture: GraphPicture) -> Figure:
    """Return the picture as a figure of one set of axes."""
    low, high = extent_of(picture)
    size = high - low
    walls = len(picture.graph)
    longer = min(LONGER_INCH * max(1.0, (walls / WALLS) ** 0.5), LARGEST_INCH)
    inch_per_m = longer / float(size.max())
    width, height = np.maximum(size * inch_per_m, (5.0, 2.0)).tolist()
    words = wrap(picture.subtitle, int(width / LETTER_INCH))
    whole = np.array([width + 2.0 * EDGE_INCH, height + 1.02 + 0.17 * len(words)])
    figure = Figure(figsize=tuple(whole), dpi=150, facecolor=palette.PAGE)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((EDGE_INCH / whole[0], 0.62 / whole[1], width / whole[0], height / whole[1]))
    left, above = EDGE_INCH / whole[0], 1.0 - 0.33 / whole[1]
    figure.text(left, above, literal(picture.title), size=12, weight="bold")
    below = above - 0.08 / whole[1]
    figure.text(left, below, literal("\n".join(words)), size=8.5, color="#5A5A5A", va="top", linespacing=1.2)
    handles = paint_graph(axes, picture, low, high, inch_per_m)
    scale_bar(axes, float(size[0]), 0.3 / height)
    figure.legend(
        handles=handles, loc="lower center", ncols=len(handles), frameon=False, fontsize=8,
        handler_map={tuple: HandlerTuple(None)},
    )  # fmt: skip
    return figure


def extent_of(picture: GraphPicture) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Return the lower left and the upper right corner of the picture's content, m."""
    points = np.concatenate([picture.map.ends_world.reshape(-1, 2), *picture.true_floor])
    return points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M


def paint_graph(
    axes: Axes,
    picture: GraphPicture,
    low: Float[np.ndarray, "2"],
    high: Float[np.ndarray, "2"],
    inch_per_m: float,
    largest_points: float = RADIUS_POINTS,
) -> list[Line2D]:
    """Draw map and graph, and return the legend.

    `inch_per_m` is the scale of the axes, `largest_points` the radius of a circle in a map of few walls.
    """
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()
    ids = picture.map.ids
    kept = np.flatnonzero(np.isin(ids, list(picture.graph)))
    rows = {int(wall): row for row, wall in enumerate(ids[kept])}
    points_per_m = 72.0 * inch_per_m
    crowd = min(1.0, (WALLS / max(len(kept), 1)) ** 0.5)
    radius_points = max(largest_points * crowd, LEAST_POINTS)
    nodes = nodes_of(picture.map.ends_world[kept], radius_points / points_per_m)
    head_m = HEAD_POINTS * max(crowd, 0.5) / points_per_m
    edges = _edges(picture, rows)
    route = [rows[wall] for wall in picture.route if wall in rows]
    _paint_floor(axes, picture, nodes, route)
    handles = [*_paint_sights(axes, nodes, edges, head_m, crowd), *_paint_neighbours(axes, nodes, edges, crowd)]
    handles += _paint_route(axes, nodes, edges, route, 1.6 * head_m)
    names = [picture.names.get(int(wall), str(wall)) for wall in ids[kept]]
    _paint_nodes(axes, nodes, names, route, radius_points)
    return handles


def _edges(picture: GraphPicture, rows: Mapping[int, int]) -> _Edges:
    met = [(a, b) for chain in picture.chains for a, b in neighbours(chain) if a in rows and b in rows]
    edges = ((a, b) for a, b, edge in picture.graph.edges(data=True) if edge["kind"] != NEIGHBOUR)
    sights = {(a, b) for a, b in edges if a in rows and b in rows}
    next_to = [(rows[a], rows[b]) for a, b in met]
    mutual = sorted((rows[a], rows[b]) for a, b in sights if (b, a) in sights and a < b)
    single = sorted((rows[a], rows[b]) for a, b in sights if (b, a) not in sights)
    return _Edges(*(np.array(found, dtype=int).reshape(-1, 2) for found in (next_to, mutual, single)))


def _paint_floor(axes: Axes, picture: GraphPicture, nodes: Nodes, route: Sequence[int]) -> None:
    for index, ring in enumerate(picture.true_floor):
        axes.fill(*ring.T, facecolor=palette.SOLID if index else palette.FLOOR, edgecolor=palette.SOLID, linewidth=5.0)
    for row in route:
        colour = palette.GOAL if row == route[-1] else palette.TO_FOLLOW
        axes.plot(*nodes.ends_world[row].T, color=colour, linewidth=7.0, solid_capstyle="round", zorder=2.5)
    axes.add_collection(
        LineCollection(
            list(nodes.ends_world), colors=palette.INK, linewidths=1.8, capstyle="round", zorder=3
        )
    )  # fmt: skip


def _paint_sights(axes: Axes, nodes: Nodes, edges: _Edges, head_m: float, crowd: float) -> list[Line2D]:
    tips = []
    curves = []
    for pairs, ends in ((edges.mutual, (-1, 0)), (edges.single, (-1,))):
        found = nodes.sights(pairs)
        curves += list(found)
        tips += [heads(found[:, end], found[:, end - 1 if end else 1], head_m) for end in ends]
    if not curves:
        return []
    axes.add_collection(LineCollection(curves, colors=palette.SIGHT, linewidths=0.9 * max(crowd, 0.4), zorder=3.5))
    axes.add_collection(
        PolyCollection(list(np.concatenate(tips)), facecolors=palette.NEIGHBOUR, linewidths=0, zorder=3.6)
    )
    words = "seen from there" if not len(edges.mutual) else "seen from there (two heads: both ways)"
    return [Line2D([], [], color=palette.NEIGHBOUR, linewidth=0.9, marker=">", markersize=4, markevery=[], label=words)]


def _paint_neighbours(axes: Axes, nodes: Nodes, edges: _Edges, crowd: float) -> list[Line2D]:
    ways = [nodes.round_corner(a, b) for a, b in edges.neighbours.tolist()]
    if not ways:
        return []
    width = 2.0 * max(crowd, 0.5)
    axes.add_collection(LineCollection(ways, colors=palette.NEW, linewidths=width, capstyle="round", zorder=4))
    return [Line2D([], [], color=palette.NEW, linewidth=2.0, label="neighbours in a chain")]


def _paint_route(axes: Axes, nodes: Nodes, edges: _Edges, route: Sequence[int], head_m: float) -> list[Line2D]:
    met = {tuple(pair) for pair in edges.neighbours.tolist()}
    ways = []
    for a, b in pairwise(route):
        if (a, b) in met:
            ways.append(nodes.round_corner(a, b))
        elif (b, a) in met:
            ways.append(nodes.round_corner(b, a)[::-1])
        else:
            ways.append(nodes.sights(np.array([[a, b]]))[0])
    if not ways:
        return []
    axes.add_collection(LineCollection(ways, colors=palette.ALARM, linewidths=3.2, capstyle="butt", zorder=5))
    tips, before = np.array([way[-1] for way in ways]), np.array([way[-2] for way in ways])
    axes.add_collection(
        PolyCollection(
            list(heads(tips, before, head_m)), facecolors=palette.ALARM, edgecolors=palette.ALARM, zorder=5.1
        )
    )
    return [Line2D([], [], color=palette.ALARM, linewidth=3.2, label="planned route")]


def _paint_nodes(axes: Axes, nodes: Nodes, names: Sequence[str], route: Sequence[int], radius_points: float) -> None:
    colours = [palette.ALARM if row in route else palette.NEW for row in range(len(names))]
    axes.add_collection(
        PatchCollection(
            [Circle(tuple(at), nodes.radius_m) for at in nodes.at], facecolors=palette.PAGE, edgecolors=colours,
            linewidths=[2.0 if row in route else 1.1 for row in range(len(names))], zorder=6,
        )
    )  # fmt: skip
    for row, (at, name) in enumerate(zip(nodes.at, names, strict=True)):
        axes.text(
            at[0], at[1], literal(name), size=radius_points * (1.15 if len(name) < 3 else 0.85), ha="center",
            va="center_baseline", color=palette.INK, weight="bold" if row in route else "normal", zorder=7,
        )  # fmt: skip
