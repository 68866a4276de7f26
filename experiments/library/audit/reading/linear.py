"""A pose graph linearised at its poses: the covariance of the poses by a sparse factorisation, and the best poses.

The first pose (or the one that the file fixes) is held. Errors are in the body frame of each pose, X Exp(e).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import bsr_array, coo_array, csr_array
from scipy.sparse.linalg import splu

from chainslam.slam.geometry.poses import J, turned, wrap

from ....scoring.without_truth.relations import between
from ....usage import UsageError
from ....views.numbers import number
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


@dataclass(frozen=True)
class Linear:
    """The residuals of m edges and their derivatives by motions of n poses."""

    off: Float[np.ndarray, "m 3"]
    jacobian: csr_array
    """3 m x 3 n."""
    residual: float
    """The chi-square of the edges."""
    solve: Callable[[Float[np.ndarray, "s c"]], Float[np.ndarray, "s c"]]
    """The covariance of the poses, 3 n x 3 n, times c columns."""


def linearised(graph: Graph, name: str) -> Linear:
    """Return a graph linearised at its poses; raises UsageError where edges do not determine all of them."""
    m, n = len(graph.pairs), len(graph.ids)
    relative = between(graph.poses_world[graph.pairs[:, 0]], graph.poses_world[graph.pairs[:, 1]])
    off = between(graph.motions, relative)
    A, B = np.zeros((2, m, 3, 3))
    back = -graph.motions[:, 2]
    A[:, :2, 0], A[:, :2, 1] = (-turned(np.tile(axis, (m, 1)), back) for axis in np.eye(2))
    A[:, :2, 2], A[:, 2, 2] = -turned(relative[:, :2] @ J.T, back), -1.0
    B[:, :2, 0], B[:, :2, 1] = (turned(np.tile(axis, (m, 1)), off[:, 2]) for axis in np.eye(2))
    B[:, 2, 2] = 1.0
    rows = np.broadcast_to(3 * np.arange(m)[:, None, None] + np.arange(3)[:, None], (m, 3, 3))
    columns = [np.broadcast_to(3 * ends[:, None, None] + np.arange(3), (m, 3, 3)) for ends in graph.pairs.T]
    cells = np.concatenate([A, B]).ravel(), (np.tile(rows.ravel(), 2), np.concatenate(columns).ravel())
    jacobian = csr_array(coo_array(cells, shape=(3 * m, 3 * n)))
    information = bsr_array((graph.information, np.arange(m), np.arange(m + 1)), shape=(3 * m, 3 * m))
    free = np.delete(np.arange(3 * n), 3 * graph.fixed + np.arange(3))
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


def pair_covs_of(linear: Linear) -> PairCovs:
    """Return what tells the joint covariance of two poses."""

    def pair_covs(first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 6 6"]:
        covs = np.zeros((len(first), 6, 6))
        axes, asked = np.arange(3), np.unique(second)
        for part in np.array_split(asked, max(len(asked) // (AT_ONCE // 3), 1)):
            columns = linear.solve(_units(3 * part[:, None] + axes, linear.jacobian.shape[1])).reshape(-1, len(part), 3)
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


def _units(rows: Int[np.ndarray, "k 3"], size: int) -> Float[np.ndarray, "s c"]:
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
            tried = replace(graph, poses_world=_stepped(graph.poses_world, 0.5**halving * step.reshape(-1, 3)))
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


def _stepped(poses: Float[np.ndarray, "n 3"], steps: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Return each pose after a motion in its own frame."""
    return np.column_stack([poses[:, :2] + turned(steps[:, :2], poses[:, 2]), wrap(poses[:, 2] + steps[:, 2])])
