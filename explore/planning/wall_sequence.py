"""From the robot to a goal by a sequence of walls: along their lanes, and straight from one to the next."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count

import networkx as nx
import numpy as np
from jaxtyping import Bool, Float

from chainslam.slam.map.stochastic_map import StochasticMap

from .lanes import Lane, lanes_of
from .paths import Planner

TUBE_M = 0.25
"""So far to each side of a straight way from lane to lane the robot may evade what stands in it."""
CROSSINGS = 60
"""From lane to lane, so many of the shortest straight ways are tried."""


@dataclass(frozen=True)
class WallSequence:
    """A way by walls."""

    walls: tuple[int, ...]
    """Ids of the walls to follow, in order; none, where the goal lies straight ahead."""
    cells: Bool[np.ndarray, "h w"]
    """The floor of the way, of the planner's window: the lanes of the walls, and the crossings between them."""


@dataclass(eq=False)
class _Visit:
    """A lane as the search comes to it; without a lane, the robot itself or the goal."""

    lane: Lane | None
    at_world: Float[np.ndarray, 2]
    """Where it is come upon, m."""
    before: _Visit | None = None
    leaves_world: Float[np.ndarray, 2] | None = None
    """Where the one before is left, m; None where they have this place in common."""


@dataclass
class WallSearch:
    """Looks for the shortest way along lanes; an edge of the graph is taken where the body fits straight across.

    The search is A*, with the straight line to the nearest goal as its bound.
    """

    graph: nx.DiGraph[int]
    walls: StochasticMap
    planner: Planner
    """Of all the floor: it tells where the body fits, and nothing else."""
    standoff_m: float
    reach_m: float
    """Walls this near to the robot are in sight."""
    _lanes: dict[int, list[Lane]] = field(default_factory=dict)

    def to(self, goals_world: Float[np.ndarray, "n 2"]) -> WallSequence | None:
        """Return the sequence of walls that leads to one of some places; None if none does."""
        if not len(goals_world):
            return None
        goals = goals_world[self.planner.passable_lines(goals_world, goals_world)]
        if not len(goals):
            return None
        number = count()
        queue = [(0.0, next(number), 0.0, _Visit(None, self._here))]
        done: set[Lane | None] = set()
        while queue:
            _, _, metres, visit = heapq.heappop(queue)
            if visit.before is not None and visit.lane is None:
                return self._sequence(visit)
            if visit.lane in done:
                continue
            done.add(visit.lane)
            for reached in self._from(visit, goals, done):
                leg = np.hypot(*(reached.at_world - visit.at_world))
                if reached.leaves_world is not None:
                    leg = np.hypot(*(reached.leaves_world - visit.at_world)) + np.hypot(
                        *(reached.at_world - reached.leaves_world)
                    )
                driven = metres + float(leg)
                straight = float(np.hypot(*(goals - reached.at_world).T).min())
                heapq.heappush(queue, (driven + straight, next(number), driven, reached))
        return None

    @property
    def _here(self) -> Float[np.ndarray, 2]:
        return self.walls.belief.pose_world[:2]

    def _from(self, visit: _Visit, goals: Float[np.ndarray, "n 2"], done: set[Lane | None]) -> Iterator[_Visit]:
        """Yield what a visit leads to: the goal, if it can be gone to straight, and the lanes of walls seen from it."""
        stops = visit.at_world[None]
        if visit.lane is not None:
            stops = np.concatenate([stops, visit.lane.stops_world])
            inside = self._inside(visit.lane, goals)
            if inside.any():
                near = goals[inside]
                best = near[np.argmin(np.hypot(*(near - visit.at_world).T))]
                yield _Visit(None, best, visit)
        crossing = self._crossing(visit.at_world, stops, goals)
        if crossing is not None:
            yield _Visit(None, crossing[1], visit, crossing[0])
        for wall in self._seen_from(visit):
            for lane in self._lanes_of(wall):
                if lane in done:
                    continue
                if self._inside(lane, visit.at_world[None])[0]:
                    yield _Visit(lane, visit.at_world, visit)
                    continue
                crossing = self._crossing(visit.at_world, stops, lane.stops_world)
                if crossing is not None:
                    yield _Visit(lane, crossing[1], visit, crossing[0])

    def _seen_from(self, visit: _Visit) -> list[int]:
        if visit.lane is None:
            near = self.walls.distances_m <= self.reach_m
            return [int(wall) for wall in self.walls.ids[near & ~self.walls.tentative]]
        wall = visit.lane.wall
        return sorted(self.graph.successors(wall)) if wall in self.graph else []

    def _lanes_of(self, wall: int) -> list[Lane]:
        if wall not in self._lanes:
            self._lanes[wall] = lanes_of(wall, self.walls, self.planner, self.standoff_m)
        return self._lanes[wall]

    def _crossing(
        self, at: Float[np.ndarray, 2], starts: Float[np.ndarray, "k 2"], ends: Float[np.ndarray, "m 2"]
    ) -> tuple[Float[np.ndarray, 2], Float[np.ndarray, 2]] | None:
        """Return the straight way, free for the body, by which the least is driven from a place; None if none is."""
        metres = np.hypot(*(starts - at).T)[:, None] + np.hypot(*(ends - starts[:, None]).transpose(2, 0, 1))
        shortest = np.argsort(metres, axis=None, kind="stable")
        spread = shortest[:: max(len(shortest) // CROSSINGS, 1)]
        for tried in (shortest[:CROSSINGS], spread):
            k, m = np.unravel_index(tried, metres.shape)
            free = np.flatnonzero(self.planner.passable_lines(starts[k], ends[m]))
            if len(free):
                return starts[k[free[0]]], ends[m[free[0]]]
        return None

    def _inside(self, lane: Lane, places: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        columns = self._columns
        cells = self.planner.rows_and_columns(places)
        return np.isin(cells @ [columns, 1], lane.cells @ [columns, 1])

    @cached_property
    def _columns(self) -> int:
        return int(self.planner.nowhere.shape[1])

    def _sequence(self, goal: _Visit) -> WallSequence:
        cells, walls = self.planner.nowhere, []
        visit: _Visit | None = goal
        while visit is not None:
            if visit.lane is not None:
                cells[tuple(visit.lane.cells.T)] = True
                walls.append(visit.lane.wall)
            if visit.leaves_world is not None:
                self._draw(cells, visit.leaves_world, visit.at_world)
            visit = visit.before
        return WallSequence(tuple(reversed(walls)), cells)

    def _draw(self, cells: Bool[np.ndarray, "h w"], a: Float[np.ndarray, 2], b: Float[np.ndarray, 2]) -> None:
        """Take in the floor beside a straight way."""
        first, box = self.planner.passable_box(np.minimum(a, b) - TUBE_M, np.maximum(a, b) + TUBE_M)
        places = self.planner.centres(first, box.shape) - a
        way = b - a
        share = np.clip(places @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
        near = np.hypot(*np.moveaxis(places - share[..., None] * way, -1, 0)) <= TUBE_M
        cells[first[0] : first[0] + box.shape[0], first[1] : first[1] + box.shape[1]] |= near
