"""What a factor graph believes: its last pose carried ahead by waiting predictions, its lines about their anchors."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Belief, Joint, StaleBeliefError
from ...geometry.poses import compose
from ..frame.frame import Frame
from .ahead import Ahead
from .kernels import cov_world, joint_ahead, means_world
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
    pose_cov = in_world(frame, ahead.pose, anchors[:0], anchors[:0], ahead.pose_cov(solver.pose_cov()))
    lines = solver.lines
    means = means_world(frame.pose_world, lines, inner_anchors)
    answers: list[tuple[Int[np.ndarray, " m"], Joint]] = []

    def ask(rows: Int[np.ndarray, " m"]) -> Joint:
        joint = joint_ahead(solver.joint_cov(rows), ahead.F, lines[rows], inner_anchors[rows])
        cov = in_world(frame, ahead.pose, means[rows], anchors[rows], joint)
        cov[:3, :3] = pose_cov
        return Joint(np.concatenate([ahead.pose, means[rows].ravel()]), cov, anchors[rows])

    def query(wanted: Int[np.ndarray, " m"]) -> Joint:
        if not is_present():
            raise StaleBeliefError("expected a belief of the present step, found one whose back end has moved on")
        rows = belief.rows(wanted)
        if not answers or not np.all(np.isin(rows, answers[0][0])):
            answers[:] = [(rows, ask(rows))]
        known, joint = answers[0]
        order = np.argsort(known)
        return joint.take(order[np.searchsorted(known, rows, sorter=order)])

    belief = Belief(ahead.pose, pose_cov, solver.ids, anchors, means, query)
    return belief


def in_world(
    frame: Frame,
    pose_world: Float[np.ndarray, "3"],
    means: Float[np.ndarray, "m 2"],
    anchors: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "s s"],
) -> Float[np.ndarray, "s s"]:
    """Add the frame's own error to a covariance of a pose and of lines about their anchors, world frame."""
    return cov_world(frame.pose_world, frame.root, pose_world, means, anchors, cov)


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
