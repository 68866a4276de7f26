"""Pose graphs in g2o's text format, and the covariances that they state: the marginals of their poses."""

from pathlib import Path

import numpy as np

from chainslam.slam.evaluation.consistency import chi2_band
from chainslam.slam.geometry.poses import wrap

from ....scoring.without_truth.references import lines_of
from ....usage import UsageError
from ....views.numbers import number
from .linear import Graph, linearised, pair_covs_of
from .stated import Stated, symmetric

VERTEX, EDGE, FIX = "VERTEX_SE2", "EDGE_SE2", "FIX"
COLUMNS = {VERTEX: 4, EDGE: 11}
LARGEST = 1e15
"""Numbers beyond it are none that a graph has."""
LEFT_OUT = 0.5
"""Share of lines of other kinds beyond which a file is refused."""


def is_graph(path: Path) -> bool:
    """Return whether a path is named as a graph."""
    return path.suffix == ".g2o"


def read_graph(path: Path) -> Stated:
    """Read a graph's poses, at the times of their ids, with their marginals if it has edges; raises UsageError."""
    graph = graph_at(path)
    if not len(graph.pairs):
        return Stated(path.name, graph.ids.astype(np.float64), graph.poses_world, notes=graph.notes)
    linear = linearised(graph, path.name)
    dof = max(3 * (len(graph.pairs) - len(graph.ids) + 1), 1)
    pair_covs = pair_covs_of(linear)
    covs = pair_covs(every := np.arange(len(graph.ids)), every)[:, :3, :3]
    notes = (*graph.notes, f"covariances are the marginals of the graph as it stands, about vertex"
             f" {graph.ids[graph.fixed]}", _of_edges(linear.residual, dof))  # fmt: skip
    return Stated(
        path.name, graph.ids.astype(np.float64), graph.poses_world, covs, notes, "body", graph.fixed, pair_covs
    )  # fmt: skip


def _of_edges(residual: float, dof: int) -> str:
    """Return what the chi-square of the edges tells of their information."""
    low, high = chi2_band(dof)
    words = "as stated" if low <= residual <= high else "too small for their noise" if residual < low else (
        "their noise is larger than stated, or the graph is not optimised"
    )  # fmt: skip
    return f"chi-square of its edges {number(residual)}, ideally {dof}: {words}"


def graph_at(path: Path) -> Graph:
    """Read a graph in the plane; raises UsageError."""
    what = f"{VERTEX} and {EDGE} lines"
    expected, lines = f"expected {what} in {path}", lines_of(path, what)
    rows: dict[str, list[list[float]]] = {VERTEX: [], EDGE: []}
    fixed, others = [], dict[str, int]()
    for at, line in enumerate(lines, 1):
        kind, *words = line.split() or ["#"]
        if kind in COLUMNS or kind == FIX:
            try:
                numbers = [float(word) for word in words]
            except ValueError as error:
                raise UsageError(f"{expected} with numbers, found other words in line {at}: correct it") from error
            if kind != FIX and (len(numbers) != COLUMNS[kind] or not np.all(np.abs(numbers) <= LARGEST)):
                raise UsageError(f"{expected} with {COLUMNS[kind]} numbers, found others in line {at}: correct it")
            fixed.extend(numbers) if kind == FIX else rows[kind].append(numbers)
        elif not kind.startswith("#"):
            others[kind] = others.get(kind, 0) + 1
    vertices, edges = (np.array(rows[kind]).reshape(-1, COLUMNS[kind]) for kind in (VERTEX, EDGE))
    if not len(vertices) or sum(others.values()) > LEFT_OUT * (len(vertices) + len(edges)):
        found = ", ".join(others) or "none"
        raise UsageError(f"{expected}, found {found}: only graphs of poses in the plane can be read")
    ids = vertices[:, 0].astype(np.int64)
    order = np.argsort(ids, kind="stable")
    ids, vertices = ids[order], vertices[order]
    ends = edges[:, :2].astype(np.int64)
    if len(np.unique(ids)) < len(ids) or not np.all(np.isin(ends, ids)):
        raise UsageError(f"{expected} with edges between vertices of ids of their own, found others: correct it")
    held = int(np.searchsorted(ids, fixed[0])) if fixed and fixed[0] in ids else 0
    notes = tuple(f"{count} lines {kind} are left out" for kind, count in others.items())
    poses = np.column_stack([vertices[:, 1:3], wrap(vertices[:, 3])])
    motions = np.column_stack([edges[:, 2:4], wrap(edges[:, 4])])
    return Graph(ids, poses, np.searchsorted(ids, ends), motions, symmetric(edges[:, 5:], 3), held, notes)
