"""From a goal wall to the sequence of walls that leads there (paper, section 3.2)."""

from __future__ import annotations

from collections.abc import Collection

import networkx as nx


def route(graph: nx.DiGraph[int], here: int | None, goal: int) -> tuple[int, ...]:
    """Return the walls to follow from the present one to the goal, both included, by the fewest changes of wall.

    Among equals the one with the lowest ids comes first. Where no way is known the goal stands alone: the robot
    then looks for one over the free floor.
    """
    if here is None or here == goal or here not in graph or goal not in graph:
        return (goal,)
    came_from = dict(nx.bfs_predecessors(graph, here, sort_neighbors=sorted))
    if goal not in came_from:
        return (goal,)
    walls = [goal]
    while walls[-1] != here:
        walls.append(came_from[walls[-1]])
    return tuple(reversed(walls))


def sequence(
    graph: nx.DiGraph[int], near: Collection[int], goal: int, closed: Collection[tuple[int, int]] = ()
) -> tuple[int, ...]:
    """Return the walls to follow, from one of those `near` the robot to the goal, by the fewest changes of wall.

    Edges that are `closed` are left out. Without a sequence there is no wall.
    """
    if goal in near:
        return (goal,)
    sources = {wall for wall in near if wall in graph}
    if not sources or goal not in graph:
        return ()
    open_edges = nx.restricted_view(graph, (), closed)
    try:
        _, walls = nx.multi_source_dijkstra(open_edges, sources, goal, weight=None)
    except nx.NetworkXNoPath:
        return ()
    return tuple(walls)
