"""The visibility graph: over the map under `/world/BACKEND/visibility`, and on its own under `/graph/BACKEND`."""

import numpy as np
from jaxtyping import Float

from ... import palette
from ..block import Block
from ..colours import packed
from ..recording import RerunRecording
from .map_layers import style

UNITS_PER_M = 45.0
"""Spacing of nodes in the graph's own view, where y points down."""


class SightsLayer:
    """Walls as nodes at their middles; neighbours in a chain, and walls seen from others."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._world, self._graph = out, f"/world/{backend}/visibility", f"/graph/{backend}"
        out.fixed(f"{self._world}/sights", style(0.5, 12.0, colors=packed(palette.SIGHT)))
        out.fixed(f"{self._world}/neighbours", style(1.0, 13.0, colors=packed(palette.NEIGHBOUR)))

    def send(self, block: Block) -> None:
        """Send the graph at the steps that have one."""
        chosen = [at for at, row in enumerate(block.rows) if row.sights is not None and row.sights.nodes]
        if not chosen:
            return
        when, nodes, edges = block.moments.take(chosen), [], []
        lines: dict[str, list[Float[np.ndarray, "e 2 2"]]] = {"sights": [], "neighbours": []}
        for at in chosen:
            row = block.rows[at]
            sights = row.sights
            assert sights is not None
            middles = block.ends[block.walls_at(at)].mean(axis=1)
            known = np.isin(sights.edges, row.walls.ids).all(axis=1)
            pairs = np.searchsorted(row.walls.ids, sights.edges[known])
            is_neighbour = sights.is_neighbour[known]
            lines["neighbours"].append(middles[pairs[is_neighbour]])
            lines["sights"].append(middles[pairs[~is_neighbour]])
            present = np.isin(row.walls.ids, sights.nodes)
            names = [str(wall) for wall in row.walls.ids[present]]
            nodes.append((names, UNITS_PER_M * middles[present] * np.array([1.0, -1.0]), row.walls.colours[present]))
            edges.append([(str(a), str(b)) for a, b in sights.edges[known].tolist()])
        for name, pieces in lines.items():
            counts = np.array([len(piece) for piece in pieces])
            self._out.strips(f"{self._world}/{name}", when, counts, np.concatenate(pieces))
        self._out.graph(self._graph, when, nodes, edges)
