"""A run's visibility graph (paper, section 3.2): `visibility.json` written, read again, and told in words."""

from pathlib import Path
from typing import Any, Literal

import networkx as nx
import numpy as np
from jaxtyping import Int
from msgspec import defstruct

from chainslam.explore.planning.visibility_graph import NEIGHBOUR, SIGHT
from chainslam.explore.step import Step

from ...scoring.records import Log, Route
from ..files import stamp
from ..reading import read_json, told
from ..schema import UnfitError, many

VISIBILITY = "visibility.json"
REMEDY = "repeat the run with this version"
Node = defstruct("Node", [("id", int)])
Edge = defstruct("Edge", [("source", int), ("target", int), ("kind", Literal[NEIGHBOUR, SIGHT])])
Planned = defstruct("Planned", [("step", int), ("walls", list[int])])
NodeLinks = defstruct("NodeLinks", [("nodes", many(Node)), ("edges", many(Edge))])
Visibility = defstruct("Visibility", [("graph", NodeLinks), ("route", Planned)])


def visibility_record(last: Step, log: Log) -> dict[str, Any]:
    """Return the graph of the last step, as networkx's node-link data, with the longest planned route."""
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(sorted(last.graph))
    graph.add_edges_from(sorted(last.graph.edges(data=True), key=lambda edge: edge[:2]))
    route = {"step": log.longest_route.step, "walls": log.longest_route.walls}
    return {**stamp(), "graph": nx.node_link_data(graph, edges="edges"), "route": route}


def read_visibility(folder: Path, ids: Int[np.ndarray, " n"]) -> tuple["nx.DiGraph[int]", Route]:
    """Return the graph in a run's folder and the longest route that was planned; raises UsageError for anything else.

    `ids` are those of the map. Walls of a route may have gone since.
    """
    path = folder / VISIBILITY
    said = read_json(path, Visibility, REMEDY)
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(node["id"] for node in said["graph"]["nodes"])
    with told(path, REMEDY):
        for edge in said["graph"]["edges"]:
            if not {edge["source"], edge["target"]} <= set(graph):
                raise UnfitError("an edge of walls that are no nodes")
            graph.add_edge(edge["source"], edge["target"], kind=edge["kind"])
        if not set(graph) <= set(ids.tolist()):
            raise UnfitError("walls that are not in map.npz")
    return graph, Route(said["route"]["step"], tuple(said["route"]["walls"]))


def graph_words(graph: "nx.DiGraph[int]", route: Route) -> str:
    """Return the size of a graph and its longest planned route, in words."""
    kinds = [str(edge["kind"]) for *_, edge in graph.edges(data=True)]
    pairs, sights = kinds.count(NEIGHBOUR) // 2, kinds.count(SIGHT)
    words = f"{len(graph)} walls, {pairs} pairs of neighbours, {sights} sights"
    if len(route.walls) < 2:
        return f"{words}; no route of several walls was planned"
    gone = [wall for wall in route.walls if wall not in graph]
    lost = f" (of which {', '.join(map(str, gone))} went since)" if gone else ""
    return f"{words}; longest planned route, at step {route.step}: walls {', '.join(map(str, route.walls))}{lost}"
