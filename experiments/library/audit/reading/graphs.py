"""Pose graphs in g2o's text format, and the covariances that they state: the marginals of their poses.

Edges are linearised at the vertices as they stand, the first one (or the one that the file fixes) is held, and the
information is inverted by a sparse factorisation. Errors are in the body frame of each pose, X Exp(e).
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from chainslam.sim.logs.archive import regular
from chainslam.slam.evaluation.consistency import chi2_band
from chainslam.slam.geometry.poses import J, turned, wrap

from ....scoring.without_truth.relations import between
from ....usage import UsageError
from ....views.numbers import number
from .stated import MOST_BYTES, Stated, symmetric

VERTEX, EDGE, FIX = "VERTEX_SE2", "EDGE_SE2", "FIX"
COLUMNS = {VERTEX: 4, EDGE: 11}
AT_ONCE = 300
"""Columns of the inverse that are computed together."""
LARGEST = 1e15
"""Numbers beyond it are none that a graph has."""
LEFT_OUT = 0.5
"""Share of lines of other kinds beyond which a file is refused."""


@dataclass(frozen=True)
class Graph:
    """A pose graph of n poses and m relations."""

    ids: Int[np.ndarray, " n"]
    poses_world: Float[np.ndarray, "n 3"]
    pairs: Int[np.ndarray, "m 2"]
    """Rows of the two poses of each edge."""
    motions: Float[np.ndarray, "m 3"]
    information: Float[np.ndarray, "m 3 3"]
    fixed: int
    """Row of the pose that is held."""
    notes: tuple[str, ...]


def is_graph(path: Path) -> bool:
    """Return whether a path is named as a graph."""
    return path.suffix == ".g2o"


def read_graph(path: Path) -> Stated:
    """Read a graph's poses, at the times of their ids, with their marginals if it has edges; raises UsageError."""
    graph = graph_at(path)
    if not len(graph.pairs):
        return Stated(path.name, graph.ids.astype(np.float64), graph.poses_world, notes=graph.notes)
    solved, residual = marginals(graph, path.name)
    dof = max(3 * (len(graph.pairs) - len(graph.ids) + 1), 1)
    pair_covs = _pairs_of(solved)
    covs = pair_covs(every := np.arange(len(graph.ids)), every)[:, :3, :3]
    notes = (*graph.notes, f"covariances are the marginals of the graph as it stands, about vertex"
             f" {graph.ids[graph.fixed]}", _of_edges(residual, dof))  # fmt: skip
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
    expected = f"expected {VERTEX} and {EDGE} lines in {path}"
    try:
        if regular(path).stat().st_size > MOST_BYTES:
            raise UsageError(f"{expected}, found more than {MOST_BYTES >> 20} MiB: name another")
        lines = path.read_text(encoding="latin-1").splitlines()
    except OSError as error:
        raise UsageError(
            f"{expected}, found {error.strerror or type(error).__name__}: name a file that exists"
        ) from error
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


def marginals(graph: Graph, name: str) -> tuple[Callable[[Int[np.ndarray, " c"]], np.ndarray], float]:
    """Return what computes columns of the covariance (3 n, c), and the chi-square of the edges; raises UsageError."""
    first, second = graph.poses_world[graph.pairs[:, 0]], graph.poses_world[graph.pairs[:, 1]]
    relative, n = between(first, second), len(graph.ids)
    off = between(graph.motions, relative)
    A, B = np.zeros((2, len(first), 3, 3))
    back = -graph.motions[:, 2]
    A[:, :2, 0], A[:, :2, 1] = (-turned(np.tile(axis, (len(first), 1)), back) for axis in np.eye(2))
    A[:, :2, 2], A[:, 2, 2] = -turned(relative[:, :2] @ J.T, back), -1.0
    B[:, :2, 0], B[:, :2, 1] = (turned(np.tile(axis, (len(first), 1)), off[:, 2]) for axis in np.eye(2))
    B[:, 2, 2] = 1.0
    residual = float(np.einsum("mi,mij,mj->", off, graph.information, off))
    blocks, places = [], []
    for one, i in ((A, 0), (B, 1)):
        for other, j in ((A, 0), (B, 1)):
            blocks.append(one.swapaxes(1, 2) @ graph.information @ other)
            places.append((graph.pairs[:, i], graph.pairs[:, j]))
    rows = np.concatenate([3 * i[:, None, None] + np.arange(3)[:, None] + np.zeros(3, int) for i, _ in places])
    columns = np.concatenate([3 * j[:, None, None] + np.arange(3) + np.zeros((3, 1), int) for _, j in places])
    H = coo_array((np.concatenate(blocks).ravel(), (rows.ravel(), columns.ravel())), shape=(3 * n, 3 * n)).tocsc()
    free = np.delete(np.arange(3 * n), 3 * graph.fixed + np.arange(3))
    try:
        solver = splu(H[free][:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    except RuntimeError as error:
        raise UsageError(
            f"expected a graph whose poses all hang together, found {name} whose information is singular: add its edges"
        ) from error

    def columns_of(asked: Int[np.ndarray, " c"]) -> Float[np.ndarray, "s c"]:
        found, place = np.zeros((3 * n, len(asked))), np.full(3 * n, -1)
        place[free] = np.arange(len(free))
        known = np.flatnonzero(place[asked] >= 0)
        right = np.zeros((len(free), len(known)))
        right[place[asked[known]], np.arange(len(known))] = 1.0
        found[np.ix_(free, known)] = solver.solve(right)
        return found

    return columns_of, residual


def _pairs_of(columns_of: Callable[[Int[np.ndarray, " c"]], np.ndarray]) -> Callable[..., Float[np.ndarray, "m 6 6"]]:
    """Return what tells the joint covariance of two poses."""

    def pair_covs(first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 6 6"]:
        covs = np.zeros((len(first), 6, 6))
        axes, asked = np.arange(3), np.unique(second)
        for part in np.array_split(asked, max(len(asked) // (AT_ONCE // 3), 1)):
            columns = columns_of((3 * part[:, None] + axes).ravel()).reshape(-1, len(part), 3)
            at = np.flatnonzero(np.isin(second, part))
            k = np.searchsorted(part, second[at])
            cross, own = (columns[3 * rows[at, None] + axes, k[:, None]] for rows in (first, second))
            covs[at, :3, 3:], covs[at, 3:, :3], covs[at, 3:, 3:] = cross, cross.swapaxes(1, 2), own
        if np.array_equal(first, second):
            covs[:, :3, :3] = covs[:, 3:, 3:]
        else:
            covs[:, :3, :3] = pair_covs(first, first)[:, 3:, 3:]
        return covs

    return pair_covs
