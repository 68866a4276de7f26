"""The graph whose nodes are walls: neighbours in a chain both ways, what was seen from where one way (section 3.2)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import networkx as nx
import numpy as np

from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

NEIGHBOUR, SIGHT = "neighbour", "sight"


class VisibilityGraph:
    """Grows with what the robot sees; a sight is never taken to hold in the other direction."""

    def __init__(self) -> None:
        self.graph: nx.DiGraph[int] = nx.DiGraph()
        self._neighbours: frozenset[tuple[int, int]] = frozenset()
        self._present: set[int] = set()
        self._shape: list[tuple[tuple[int, ...], bool]] = []

    def observe(self, walls: StochasticMap, chains: Sequence[Chain], followed: int | None, seen: Iterable[int]) -> None:
        """Bring nodes and neighbours up to the map, and note which walls were seen while one was followed."""
        present = set(walls.ids[~walls.tentative].tolist())
        if present != self._present:
            self.graph.remove_nodes_from([node for node in self.graph if node not in present])
            self.graph.add_nodes_from(present)
            self._present = present
        if (shape := [(chain.walls, chain.is_closed) for chain in chains]) != self._shape:
            self._connect(pair for chain in chains for pair in neighbours(chain))
            self._shape = shape
        if followed is not None and followed in present:
            for wall in seen:
                if wall in present and wall != followed and not self.graph.has_edge(followed, wall):
                    self.graph.add_edge(followed, wall, kind=SIGHT)

    def _connect(self, pairs: Iterable[tuple[int, int]]) -> None:
        """Make edges both ways between the pairs, and take away those of pairs that no longer meet."""
        edges = frozenset(edge for a, b in pairs for edge in ((a, b), (b, a)))
        self.graph.remove_edges_from(self._neighbours - edges)
        self.graph.add_edges_from(sorted(edges - self._neighbours), kind=NEIGHBOUR)
        self._neighbours = edges


def neighbours(chain: Chain) -> list[tuple[int, int]]:
    """Return the pairs of walls that meet at the corners of a chain."""
    following = chain.walls[1:] + chain.walls[:1] if chain.is_closed else chain.walls[1:]
    return [(a, b) for a, b in zip(chain.walls, following, strict=False) if a != b]


def followed_wall(walls: StochasticMap, reach_m: float = 1.0, rather: Collection[int] = ()) -> int | None:
    """Return the id of the wall that the robot drives along: the nearest one whose free side it is on.

    Round an outer corner two walls are equally near: the one in `rather` counts there.
    """
    rows = np.flatnonzero(~walls.tentative)
    if not len(rows):
        return None
    ends = walls.ends_world[rows]
    along, offset = ends[:, 1] - ends[:, 0], walls.belief.pose_world[:2] - ends[:, 0]
    is_behind = along[:, 0] * offset[:, 1] < along[:, 1] * offset[:, 0]
    distance = np.where(is_behind, np.inf, walls.distances_m[rows])
    best = int(distance.argmin())
    if len(rather):
        tied = np.flatnonzero(np.isclose(distance, distance[best])).tolist()
        best = min((k for k in tied if walls.ids[rows[k]] in rather), key=distance.__getitem__, default=best)
    return int(walls.ids[rows[best]]) if distance[best] <= reach_m else None
