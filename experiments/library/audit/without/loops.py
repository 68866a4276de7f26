"""Loop closures of a pose graph, each against its prediction by the graph without it.

The graph is optimised, and e and C are the residual of an edge and the covariance of its prediction, of which the edge
of information W = L L' is a part. Without the edge the residual is (I - C W)^-1 e and has the covariance C_- + W^-1,
C_-^-1 = C^-1 - W. So w = (I - M)^-1/2 L' e with M = L' C L is white. Closures whose predictions share poses depend on
each other: Cov(w_i, w_j) = -(I - M_i)^-1/2 L_i' C_ij L_j (I - M_j)^-1/2, of which the sum of squares gives the degrees
of freedom of the mean.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ....usage import UsageError
from ....views.numbers import number
from ..draws import AT_ONCE, Cross, joint_dof
from ..geometry.kinds import parts as axes_of
from ..reading.graphs import Rotations, graph_at
from ..reading.linear import Linear, optimised
from ..reading.stated import Space
from ..suspicions import definite
from .inner import Inner, Told

ALONE = 1e-6
"""How near to 1 the part of an edge in its own prediction is, in some direction, if nothing else determines it."""
TOLD = Told(
    "loop closures against the rest of the graph",
    "loop closures",
    "NEES per degree of freedom",
    "whether each closure agrees with the graph without it as closely as the information of the edges says",
    "whether the graph is right: an error that odometry and closures share leaves them in agreement, so the pose itself"
    " cannot be judged",
    "id of the later pose",
)


def loops(path: Path, space: Space = "plane", rotation: Rotations | None = None) -> Inner:
    """Return the loop closures of a g2o graph; raises UsageError if it has none that the rest predicts."""
    graph = graph_at(path, space, rotation)
    rows = np.flatnonzero(np.abs(np.diff(graph.pairs, axis=1)[:, 0]) > 1)
    if not len(rows):
        raise UsageError(
            f"expected edges in {path} that do not join successive poses, found none: nothing predicts one"
        )
    graph, linear, notes = optimised(graph, path.name)
    usable = definite(graph.information[rows])
    rows, left = rows[usable], int(np.count_nonzero(~usable))
    notes += (f"{left} closures whose information is not positive definite are left out",) if left else ()
    if not len(rows):
        raise UsageError(f"expected loop closures in {path} with positive definite information, found none: correct it")
    roots = np.linalg.cholesky(graph.information[rows])
    parts, axes = np.linalg.eigh(roots.swapaxes(1, 2) @ _own(linear, rows) @ roots)
    known = 1.0 - parts[:, -1] > ALONE
    if left := int(np.count_nonzero(~known)):
        notes += (f"{left} closures that nothing else predicts are left out",)
    if not np.any(known):
        raise UsageError(f"expected loop closures in {path} that the rest predicts, found none: add edges")
    rows, roots, parts, axes = rows[known], roots[known], parts[known], axes[known]
    whiten = axes @ (axes.swapaxes(1, 2) / np.sqrt(1.0 - parts)[:, :, None]) @ roots.swapaxes(1, 2)
    white = (whiten @ linear.off[rows, :, None])[..., 0]
    ends = graph.ids[graph.pairs[rows]]
    names = tuple(f"{i}-{j} ({number(size)} m off)" for (i, j), size in zip(
        ends.tolist(), _shifts(linear, rows, roots, parts, axes), strict=True
    ))  # fmt: skip
    order = np.argsort(ends.max(axis=1), kind="stable")
    return Inner(
        path.name, TOLD, ends.max(axis=1)[order].astype(np.float64), np.sum(white**2, axis=1)[order],
        np.full(len(rows), graph.axes), tuple(names[row] for row in order), joint_dof(whiten, _cross(linear, rows)),
        (*graph.notes, *notes),
    )  # fmt: skip


def _shifts(
    linear: Linear,
    rows: Int[np.ndarray, " m"],
    roots: Float[np.ndarray, "m d d"],
    parts: Float[np.ndarray, "m d"],
    axes: Float[np.ndarray, "m d d"],
) -> list[float]:
    """Return how far, m, each closure is from its prediction without it."""
    turned = axes.swapaxes(1, 2) @ roots.swapaxes(1, 2) @ linear.off[rows, :, None]
    back = np.linalg.solve(roots.swapaxes(1, 2), axes @ (turned / (1.0 - parts)[:, :, None]))
    position, _ = axes_of(back.shape[1])
    return np.linalg.norm(back[:, position, 0], axis=1).tolist()


def _own(linear: Linear, rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m d d"]:
    """Return the covariance of the prediction of each edge, itself included."""
    found, d = [], linear.off.shape[1]
    for part in np.array_split(rows, -(-len(rows) // AT_ONCE)):
        G = linear.jacobian[_cells(part, d)]
        blocks = (G @ linear.solve(G.T.toarray())).reshape(len(part), d, len(part), d)
        found.append(np.einsum("iaib->iab", blocks))
    return np.concatenate(found)


def _cross(linear: Linear, rows: Int[np.ndarray, " m"]) -> Cross:
    """Return what tells the covariances of the predictions of edges, itself included, with each other."""
    d, every = linear.off.shape[1], linear.jacobian[_cells(rows, linear.off.shape[1])]

    def cross(some: Int[np.ndarray, " k"]) -> Float[np.ndarray, "m d k d"]:
        found = every @ linear.solve(linear.jacobian[_cells(rows[some], d)].T.toarray())
        return np.asarray(found.reshape(len(rows), d, len(some), d))

    return cross


def _cells(rows: Int[np.ndarray, " m"], axes: int) -> Int[np.ndarray, " r"]:
    """Return the rows of the residuals of edges."""
    return (axes * rows[:, None] + np.arange(axes)).ravel()
