"""Observations of several lines taken together: where they put the pose and the lines, and which of them agree."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import Joint, Observations, columns_of
from ..estimation.gates import gate_level
from ..estimation.models import Innovations, halfway, innovations, stack


@dataclass(frozen=True)
class JointObservations:
    """What m observations of a joint Gaussian's lines say of its pose and lines."""

    e: Float[np.ndarray, " k"]
    """How they differ from what the mean predicts, k = 2 m."""
    PHt: Float[np.ndarray, "s k"]
    """Covariance of the state with e."""
    S: Float[np.ndarray, "k k"]
    """Covariance of e."""

    def take(self, rows: Int[np.ndarray, " r"]) -> "JointObservations":
        """Return some of the observations."""
        at = (2 * rows[:, None] + np.arange(2)).ravel()
        return JointObservations(self.e[at], self.PHt[:, at], self.S[at[:, None], at])

    def gain(self) -> Float[np.ndarray, "s k"]:
        """Return by how much each part of e moves the state."""
        return np.linalg.solve(self.S, self.PHt.T).T


def taken_together(joint: Joint, rows: Int[np.ndarray, " m"], model: Innovations) -> JointObservations:
    """Join the innovations of m observations of the joint's lines in these rows; several may be of one line."""
    linear = stack(rows, model)
    columns = columns_of(linear.rows)
    PHt = joint.cov[:, columns] @ linear.H.T
    return JointObservations(linear.e, PHt, linear.H @ PHt[columns] + linear.R)


@dataclass(frozen=True)
class Nis:
    """How far a scan's observations lie from what was predicted of them, together."""

    squared: float
    """Normalised innovation squared, e' S^-1 e: of a chi-square variable if the belief is honest."""
    dof: int
    """Its degrees of freedom, two for each observation."""


NO_NIS = Nis(0.0, 0)


def relocate(joint: Joint, ids: Int[np.ndarray, " n"], observed: Observations) -> Joint:
    """Condition the joint Gaussian on observations of some of its lines (paper, step 3), as a pure function."""
    if not len(observed.ids):
        return joint
    seen, _ = seen_halfway(joint, ids, observed)
    gain = seen.gain()
    return Joint(joint.mean + gain @ seen.e, joint.cov - gain @ seen.PHt.T, joint.anchors)


def seen_halfway(
    joint: Joint, ids: Int[np.ndarray, " n"], observed: Observations
) -> tuple[JointObservations, Innovations]:
    """Join observations of some of the joint's lines, linearised halfway to where they put the pose; and each alone."""
    rows = np.searchsorted(ids, observed.ids)
    means = joint.mean[3:].reshape(-1, 2)[rows]
    model = innovations(joint.mean[:3], joint.anchors[rows], means, observed.lines, observed.cov)
    seen = taken_together(joint, rows, model)
    step = seen.gain() @ seen.e
    turn = step[3 + 2 * rows] - step[2]
    model = halfway(model, observed.lines, observed.cov, turn)
    return taken_together(joint, rows, model), model


def compatible(seen: JointObservations, gate: float, together: float) -> Int[np.ndarray, " k"]:
    """Drop observations, the worst first, until each passes the gate given all others, and all `together` their own.

    Both are levels of probability; a bad slip alone takes all together far out.

    After a step in which the wheels may have slipped by a degree each wall alone allows for that error; the other
    walls tell what it was. Returns the rows of those that are left.
    """
    kept = np.arange(len(seen.e) // 2)
    while len(kept) > 1:
        left = seen.take(kept)
        squared, losses = judged_by_the_rest(left.e, left.S)
        worst = int(np.argmax(losses))
        if squared <= gate_level(together, 2 * len(kept)) and losses[worst] <= gate_level(gate, 2):
            break
        kept = np.delete(kept, worst)
    return kept


def judged_by_the_rest(
    e: Float[np.ndarray, "*h k"], S: Float[np.ndarray, "*h k k"]
) -> tuple[Float[np.ndarray, "*h"], Float[np.ndarray, "*h m"]]:
    """Return the squared distance of m observations taken together, k = 2 m, and that of each given all others."""
    inverse = np.linalg.inv(S)
    weighted = (inverse @ e[..., None])[..., 0]
    *h, k = e.shape
    own = np.diagonal(inverse.reshape(*h, k // 2, 2, k // 2, 2), axis1=-4, axis2=-2)
    # What the sum of squares loses when one observation is left out is its own, given all others.
    losses = squared_distances(weighted.reshape(*h, k // 2, 2), np.moveaxis(own, -1, -3))
    return np.asarray(np.vecdot(e, weighted)), losses


def squared_distances(e: Float[np.ndarray, "*n 2"], S: Float[np.ndarray, "*n 2 2"]) -> Float[np.ndarray, "*n"]:
    """Return the squared Mahalanobis distance of each two-vector, e' S^-1 e."""
    det = S[..., 0, 0] * S[..., 1, 1] - S[..., 0, 1] * S[..., 1, 0]
    a, b = e[..., 0], e[..., 1]
    return np.asarray((S[..., 1, 1] * a**2 - 2.0 * S[..., 0, 1] * a * b + S[..., 0, 0] * b**2) / det)
