"""What a factor graph believes: its last pose carried ahead by waiting predictions, its lines about their anchors."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Belief, Joint, StaleBeliefError, columns_of
from ...geometry.lines import directions, normals
from ...geometry.poses import compose
from .ahead import Ahead
from .record import Record
from .solver import Solver


def believe(
    solver: Solver,
    record: Record,
    anchors: Float[np.ndarray, "n 2"],
    inner_anchors: Float[np.ndarray, "n 2"],
    is_present: Callable[[], bool],
) -> Belief:
    """Return the belief of a solver that is settled; `anchors` in the world frame, and as the solver sees them.

    The largest joint covariance asked for is kept: what is part of it is not asked of the solver again.
    """
    frame = record.frame
    ahead = Ahead(compose(frame.pose_world, solver.pose))
    for index in range(solver.last, len(record.motions)):
        ahead.move(record.motions[index], record.motion_covs[index])
    pose_cov = ahead.pose_cov(solver.pose_cov())
    means = solver.lines.copy()
    means[:, 1] -= np.vecdot(normals(means[:, 0]), inner_anchors)
    means = frame.means_world(means)
    answers: list[tuple[Int[np.ndarray, " m"], Float[np.ndarray, "s s"]]] = []

    def in_world(cov: Float[np.ndarray, "s s"], rows: Int[np.ndarray, " m"]) -> Float[np.ndarray, "s s"]:
        """Add the frame's own error, which no scan lessens."""
        moves = frame.moving(ahead.pose, means[rows], anchors[rows]) @ frame.root
        return np.asarray(cov + moves @ moves.T)

    def query(wanted: Int[np.ndarray, " m"]) -> Joint:
        if not is_present():
            raise StaleBeliefError("expected a belief of the present step, found one whose back end has moved on")
        rows = belief.rows(wanted)
        if not answers or not np.all(np.isin(rows, answers[0][0])):
            cov = in_world(ahead.joint_cov(_joint_cov(solver, rows, inner_anchors)), rows)
            cov[:3, :3] = belief.pose_cov
            answers[:] = [(rows, cov)]
        known, cov = answers[0]
        order = np.argsort(known)
        at = order[np.searchsorted(known, rows, sorter=order)]
        columns = columns_of(at)
        mean = np.concatenate([belief.pose_world, belief.means[rows].ravel()])
        return Joint(mean, cov[columns[:, None], columns], anchors[rows])

    belief = Belief(ahead.pose, in_world(pose_cov, np.zeros(0, dtype=np.int64)), solver.ids, anchors, means, query)
    return belief


def pair_covs(
    solver: Solver, record: Record, first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"]
) -> Float[np.ndarray, "m 6 6"]:
    """Return the joint covariance of pairs of poses, by their rows in the path of a solver that is settled.

    Each pose's error is in its own frame; NaN for a pose of before the first wall.
    """
    steps = np.array(record.steps) - len(record.lead)
    covs = np.full((len(first), 6, 6), np.nan)
    for k, (a, b) in enumerate(zip(steps[first].tolist(), steps[second].tolist(), strict=True)):
        if a == b >= 0:
            covs[k] = np.tile(solver.isam.pose_cov(a), (2, 2))
        elif min(a, b) >= 0:
            covs[k] = solver.isam.pair_cov(a, b)
    return covs


def _joint_cov(
    solver: Solver, rows: Int[np.ndarray, " m"], anchors: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "s s"]:
    """Return the covariance of the last pose (body frame) and these lines (alpha, d)."""
    cov = solver.joint_cov(rows)
    # d = r - n(alpha)·c, so dd = dr - (t·c) dalpha.
    lever = np.vecdot(directions(solver.lines[rows, 0]), anchors[rows])
    cov[4::2] -= lever[:, None] * cov[3::2]
    cov[:, 4::2] -= lever * cov[:, 3::2]
    return np.asarray(0.5 * (cov + cov.T))
