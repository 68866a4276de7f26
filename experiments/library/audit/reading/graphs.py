"""Pose graphs in g2o's text format, and the covariances that they state: the marginals of their poses."""

from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from chainslam.slam.evaluation.consistency import chi2_band
from chainslam.slam.geometry.poses import wrap

from ....scoring.without_truth.references import lines_of
from ....usage import UsageError
from ....views.numbers import number
from .linear import Graph, cross_covs_of, linearised, pair_covs_of
from .stated import Space, Stated, symmetric, unit

Rotations = Literal["vector", "quaternion"]
FIX = "FIX"
KINDS: dict[Space, dict[str, int]] = {
    "plane": {"VERTEX_SE2": 4, "EDGE_SE2": 11},
    "space": {"VERTEX_SE3:QUAT": 8, "EDGE_SE3:QUAT": 30},
}
"""Numbers on the lines of vertices and of edges."""
OTHERS: dict[Space, str] = {"plane": "--space space reads graphs in space", "space": "leave --space out"}
AS_VECTORS = (
    "the information of rotations is read as that of rotation vectors, as GTSAM does it; --g2o-rotation quaternion if"
    " it is g2o's own"
)
LARGEST = 1e15
"""Numbers beyond it are none that a graph has."""
NEGATIVE = 1e-9
"""Part of an information matrix by which its eigenvalues may be below 0 for the digits of the file."""
LEFT_OUT = 0.5
"""Share of lines of other kinds beyond which a file is refused."""


def is_graph(path: Path) -> bool:
    """Return whether a path is named as a graph."""
    return path.suffix == ".g2o"


def read_graph(path: Path, space: Space = "plane", rotation: Rotations | None = None) -> Stated:
    """Read a graph's poses, at the times of their ids, with their marginals if it has edges; raises UsageError."""
    graph = graph_at(path, space, rotation)
    spatial = graph.poses_world if space == "space" else None
    if not len(graph.pairs):
        times = graph.ids.astype(np.float64)
        return Stated(path.name, times, graph.poses_world, notes=graph.notes, spatial=spatial)
    linear, d = linearised(graph, path.name), graph.axes
    dof = max(d * (len(graph.pairs) - len(graph.ids) + 1), 1)
    pair_covs = pair_covs_of(linear)
    covs = pair_covs(every := np.arange(len(graph.ids)), every)[:, :d, :d]
    notes = (*graph.notes, f"covariances are the marginals of the graph as it stands, about vertex"
             f" {graph.ids[graph.fixed]}", _of_edges(linear.residual, dof))  # fmt: skip
    return Stated(
        path.name, graph.ids.astype(np.float64), graph.poses_world, covs, notes, "body", graph.fixed, pair_covs,
        cross_covs_of(linear), spatial=spatial,
    )  # fmt: skip


def _of_edges(residual: float, dof: int) -> str:
    """Return what the chi-square of the edges tells of their information."""
    low, high = chi2_band(dof)
    words = "as stated" if low <= residual <= high else "too small for their noise" if residual < low else (
        "their noise is larger than stated, or the graph is not optimised"
    )  # fmt: skip
    return f"chi-square of its edges {number(residual)}, ideally {dof}: {words}"


def graph_at(path: Path, space: Space = "plane", rotation: Rotations | None = None) -> Graph:
    """Read a graph in the plane or in space; raises UsageError.

    In space the information of an edge's rotation is that of rotation vectors, or of x, y and z of quaternions, which
    are half as large.
    """
    columns = KINDS[space]
    vertex, edge = columns
    what = f"{vertex} and {edge} lines"
    expected, lines = f"expected {what} in {path}", lines_of(path, what)
    rows: dict[str, list[list[float]]] = {vertex: [], edge: []}
    fixed, others = [], dict[str, int]()
    for at, line in enumerate(lines, 1):
        kind, *words = line.split() or ["#"]
        if kind in columns or kind == FIX:
            try:
                numbers = [float(word) for word in words]
            except ValueError as error:
                raise UsageError(f"{expected} with numbers, found other words in line {at}: correct it") from error
            if kind != FIX and (len(numbers) != columns[kind] or not np.all(np.abs(numbers) <= LARGEST)):
                raise UsageError(
                    f"{expected} with {columns[kind]} numbers within {LARGEST:g}, found others in line {at}: correct it"
                )
            fixed.extend(numbers) if kind == FIX else rows[kind].append(numbers)
        elif not kind.startswith("#"):
            others[kind] = others.get(kind, 0) + 1
    vertices, edges = (np.array(rows[kind]).reshape(-1, count) for kind, count in columns.items())
    if not len(vertices) or sum(others.values()) > LEFT_OUT * (len(vertices) + len(edges)):
        found = ", ".join(others) or "none"
        is_other = any(kind in others for kinds in KINDS.values() for kind in kinds)
        raise UsageError(f"{expected}, found {found}: {OTHERS[space] if is_other else 'name a graph of poses'}")
    _check_ids(expected, vertices[:, 0], edges[:, :2])
    ids = vertices[:, 0].astype(np.int64)
    order = np.argsort(ids, kind="stable")
    ids, vertices = ids[order], vertices[order]
    ends = edges[:, :2].astype(np.int64)
    held = int(np.searchsorted(ids, fixed[0])) if fixed and fixed[0] in ids else 0
    notes = tuple(f"{count} lines {kind} are left out" for kind, count in others.items())
    if fixed and fixed != [ids[held]]:
        notes += (f"of the vertices that FIX names only {ids[held]} is held",) if fixed[0] in ids else (
            f"FIX names no vertex of the graph, so {ids[held]} is held",)  # fmt: skip
    poses, motions = vertices[:, 1:], edges[:, 2 : 1 + columns[vertex]]
    information = symmetric(edges[:, 1 + columns[vertex] :], 3 if space == "plane" else 6)
    if space == "plane":
        poses, motions = (np.column_stack([each[:, :2], wrap(each[:, 2])]) for each in (poses, motions))
    else:
        poses, motions = (
            np.column_stack([each[:, :3], unit(each[:, 3:], path, f"the lines of {kind}, line")])
            for each, kind in ((poses, vertex), (motions, edge))
        )
        if rotation == "quaternion":
            information[:, 3:] *= 0.5
            information[:, :, 3:] *= 0.5
        elif rotation is None and len(edges):
            notes += (AS_VECTORS,)
    least = np.linalg.eigvalsh(information)[:, 0]
    if odd := int(np.count_nonzero(least < -NEGATIVE * np.abs(information).max(axis=(1, 2)))):
        notes += (f"the information of {odd} edges has a negative eigenvalue",)
    return Graph(ids, poses, np.searchsorted(ids, ends), motions, information, held, notes)


def _check_ids(expected: str, ids: Float[np.ndarray, " n"], ends: Float[np.ndarray, "m 2"]) -> None:
    """Raise UsageError unless the ids of vertices differ and all edges join two of them."""
    known, counts = np.unique(ids, return_counts=True)
    odd = np.concatenate([ids, ends.ravel()])
    if len(odd := odd[odd != np.round(odd)]):
        raise UsageError(f"{expected} with whole numbers as ids, found {odd[0]:g}: correct it")
    if counts.max() > 1:
        raise UsageError(f"{expected} with a vertex for each id, found {known[counts > 1][0]:.0f} twice: correct it")
    if len(missing := ends[~np.isin(ends, ids)]):
        raise UsageError(f"{expected} with edges between vertices, found none of id {missing[0]:.0f}: add it")
    if len(same := ends[ends[:, 0] == ends[:, 1]]):
        raise UsageError(f"{expected} with edges between two vertices, found one at {same[0, 0]:.0f} only: omit it")
