"""From a goal wall to the sequence of walls that leads there (paper, section 3.2)."""

from __future__ import annotations

import heapq
from collections.abc import Collection

import networkx as nx

from .visibility_graph import NEIGHBOUR


def sequence(
    graph: nx.DiGraph[int], near: Collection[int], goal: int, closed: Collection[tuple[int, int]] = ()
) -> tuple[int, ...]:
    """Return the walls to follow, from one of those `near` the robot to the goal, by the fewest changes of wall.

    Among equals the one with the most neighbours in a chain comes first: round a corner the robot goes on following,
    across the floor to a wall that was seen it has to find a way. Then the one with the lowest ids. Edges that are
    `closed` are left out. Without a sequence there is no wall.
    """
    queue: list[tuple[int, int, tuple[int, ...]]] = [(0, 0, (wall,)) for wall in sorted(near)]
    done: set[int] = set()
    while queue:
        changes, sights, walls = heapq.heappop(queue)
        here = walls[-1]
        if here == goal:
            return walls
        if here in done or here not in graph:
            continue
        done.add(here)
        for wall, edge in graph[here].items():
            if wall not in done and (here, wall) not in closed:
                is_sight = edge.get("kind") != NEIGHBOUR
                heapq.heappush(queue, (changes + 1, sights + is_sight, (*walls, wall)))
    return ()
