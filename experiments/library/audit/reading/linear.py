"""A pose graph linearised at its poses: the covariance of the poses by a sparse factorisation, and the best poses.

The first pose (or the one that the file fixes) is held. Errors are in the body frame of each pose, X Exp(e).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import bsr_array, coo_array, csr_array
from scipy.sparse.linalg import splu

from ....usage import UsageError
from ....views.numbers import number
from ..draws import Cross
from ..geometry.kinds import Geometry, geometry_of
from .stated import PairCovs

AT_ONCE = 300
"""Columns of the inverse that are computed together."""
ROUNDS = 30
DONE, ENOUGH = 1e-10, 1e-3
"""A step that lessens the chi-square by less ends the optimisation; by how little it may if rounding stops it."""
HALVINGS = 6
MOVED = 0.1
"""A graph whose chi-square is lessened by more, per pose, was not optimised."""


@dataclass(frozen=True)
class Graph:
    """A pose graph of n poses and m relations, in the plane or in space."""

    ids: Int[np.ndarray, " n"]
    poses_world: Float[np.ndarray, "n p"]
    pairs: Int[np.ndarray, "m 2"]
    """Rows of the two poses of each edge."""
    motions: Float[np.ndarray, "m p"]
    information: Float[np.ndarray, "m d d"]
    """Of shift and turn of each motion: d is 3 in the plane, 6 in space."""
    fixed: int
    """Row of the pose that is held."""
    notes: tuple[str, ...]

    @property
    def axes(self) -> int:
        """The number d of axes of errors."""
        return self.information.shape[1]

    @property
    def by(self) -> Geometry:
        """The geometry of its poses."""
        return geometry_of(self.poses_world)


@dataclass(frozen=True)
class Linear:
    """The residuals of m edges and their derivatives by motions of n poses."""

    off: Float[np.ndarray, "m d"]
    jacobian: csr_array
    """d m x d n."""
    residual: float
    """The chi-square of the edges."""
    solve: Callable[[Float[np.ndarray, "s c"]], Float[np.ndarray, "s c"]]
    """The covariance of the poses, d n x d n, times c columns."""


def linearised(graph: Graph, name: str) -> Linear:
    """Return a graph linearised at its poses; raises UsageError where edges do not determine all of them."""
    m, n, d, by = len(graph.pairs), len(graph.ids), graph.axes, graph.by
    relative = by.between(graph.poses_world[graph.pairs[:, 0]], graph.poses_world[graph.pairs[:, 1]])
    gaps = by.between(graph.motions, relative)
    off, B = by.coordinates(gaps), by.slopes(gaps)
    A = -B @ by.adjoint_of_inverse(relative)
    rows = np.broadcast_to(d * np.arange(m)[:, None, None] + np.arange(d)[:, None], (m, d, d))
    columns = [np.broadcast_to(d * ends[:, None, None] + np.arange(d), (m, d, d)) for ends in graph.pairs.T]
    cells = np.concatenate([A, B]).ravel(), (np.tile(rows.ravel(), 2), np.concatenate(columns).ravel())
    jacobian = csr_array(coo_array(cells, shape=(d * m, d * n)))
    information = bsr_array((graph.information, np.arange(m), np.arange(m + 1)), shape=(d * m, d * m))
    free = np.delete(np.arange(d * n), d * graph.fixed + np.arange(d))
    H = (jacobian.T @ information @ jacobian).tocsc()[free][:, free].tocsc()
    try:
        solver = splu(H, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    except RuntimeError as error:
        raise UsageError(
            f"expected a graph whose poses all hang together, found {name} whose information is singular: add its edges"
        ) from error

    def solve(right: Float[np.ndarray, "s c"]) -> Float[np.ndarray, "s c"]:
        found = np.zeros(right.shape)
        found[free] = solver.solve(np.ascontiguousarray(right[free]))
        return found

    residual = float(np.einsum("mi,mij,mj->", off, graph.information, off))
    return Linear(off, jacobian, residual, solve)


def cross_covs_of(linear: Linear) -> Cross:
    """Return what tells the covariances of all poses with some."""
    d = linear.off.shape[1]

    def cross_covs(some: Int[np.ndarray, " k"]) -> Float[np.ndarray, "n d k d"]:
        columns = linear.solve(_units(d * some[:, None] + np.arange(d), linear.jacobian.shape[1]))
        return columns.reshape(-1, d, len(some), d)

    return cross_covs


def pair_covs_of(linear: Linear) -> PairCovs:
    """Return what tells the joint covariance of two poses."""
    d, cross_covs = linear.off.shape[1], cross_covs_of(linear)

    def pair_covs(first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m e e"]:
        covs = np.zeros((len(first), 2 * d, 2 * d))
        asked = np.unique(second)
        for part in np.array_split(asked, max(len(asked) // (AT_ONCE // d), 1)):
            columns = cross_covs(part)
            at = np.flatnonzero(np.isin(second, part))
            k = np.searchsorted(part, second[at])
            cross, own = (columns[rows[at], :, k] for rows in (first, second))
            covs[at, :d, d:], covs[at, d:, :d], covs[at, d:, d:] = cross, cross.swapaxes(1, 2), own
        if np.array_equal(first, second):
            covs[:, :d, :d] = covs[:, d:, d:]
        else:
            covs[:, :d, :d] = pair_covs(first, first)[:, d:, d:]
        return covs

    return pair_covs


def _units(rows: Int[np.ndarray, "k d"], size: int) -> Float[np.ndarray, "s c"]:
    """Return columns that are 1 in one row each."""
    found = np.zeros((size, rows.size))
    found[rows.ravel(), np.arange(rows.size)] = 1.0
    return found


def optimised(graph: Graph, name: str) -> tuple[Graph, Linear, tuple[str, ...]]:
    """Return a graph at its most likely poses, linearised there, with a note if it was not; raises UsageError.

    The method of Gauss and Newton with halved steps, which needs poses that are not far off.
    """
    linear = linearised(graph, name)
    first = linear.residual
    for _ in range(ROUNDS):
        weighed = np.einsum("mij,mj->mi", graph.information, linear.off).ravel()
        slope = linear.jacobian.T @ weighed
        step = -linear.solve(slope[:, None])[:, 0]
        gain = -float(slope @ step)
        if not gain > DONE:
            return graph, linear, _moved(graph, first, linear.residual)
        for halving in range(HALVINGS):
            motions = graph.by.motions_of(0.5**halving * step.reshape(-1, graph.axes))
            tried = replace(graph, poses_world=graph.by.composed(graph.poses_world, motions))
            found = linearised(tried, name)
            if found.residual < linear.residual:
                break
        else:
            if gain <= ENOUGH:
                return graph, linear, _moved(graph, first, linear.residual)
            break
        graph, linear = tried, found
    raise UsageError(f"expected a graph near its most likely poses, found {name} that does not converge: optimise it")


def _moved(graph: Graph, before: float, after: float) -> tuple[str, ...]:
    if before - after <= MOVED * len(graph.ids):
        return ()
    return (f"its poses were optimised first: chi-square {number(before)} to {number(after)}",)
