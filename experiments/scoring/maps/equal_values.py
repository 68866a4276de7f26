"""Which of several uncertain values are equal to within a tolerance, by their joint covariance.

A value is one of a class of equal values, or near a class (askew), or anywhere. The shares of the three, and the
tolerance where none is given, are estimated from the values themselves (empirical Bayes): where few values are equal,
each needs more evidence. The probability of each value is conditional on all the others.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.numerics import TINY

ALONE = -1
"""In place of a class: a value that equals no other."""
SURE = 0.99
"""A value with a lower probability is not taken for equal."""
LIKELY = 0.5
"""With a higher one it helps to find the others."""
MOST_SHARE = 0.98
"""However regular a map is, each value needs some evidence of its own."""
COUNTS = np.array([1.0, 0.5, 0.5])
"""As how many values the prior of the three shares counts."""
ROUNDS = 4
CAUTION = 2.0
"""The variance of equal values is taken to be so many standard deviations above its mean: too small a tolerance makes a
map overconfident, too large a one costs some precision."""


@dataclass(frozen=True)
class Scale:
    """What values of one kind may differ by, all in their unit."""

    tolerances: tuple[float, ...]
    """Standard deviations that equal values may have about their class; each map has one."""
    askew: tuple[float, ...]
    """Standard deviations of values that are near a class without being of it, from slightly askew to plainly."""
    width: float
    """Other values are uniform over this; the period, where values have one."""
    is_periodic: bool = False

    def off(self, differences: np.ndarray) -> np.ndarray:
        """Return differences; those of periodic values to within half a period."""
        half = 0.5 * self.width
        return (differences + half) % self.width - half if self.is_periodic else differences


@dataclass(frozen=True)
class Classes:
    """Values, n of them, by class."""

    of: Int[np.ndarray, " n"]
    """The class of each value that is surely in one, otherwise `ALONE`."""
    nearest: Int[np.ndarray, " n"]
    """The class that it is or would be in, `ALONE` where there is none."""
    probability: Float[np.ndarray, " n"]
    """That it is in it."""
    tolerance: float


class _Law(NamedTuple):
    """What is taken of all values."""

    shares: Float[np.ndarray, "3"]
    """Of a class, near one, anywhere."""
    tolerance: float
    values: int


def classes(
    values: Float[np.ndarray, " n"], cov: Float[np.ndarray, "n n"], scale: Scale, tolerance: float | None = None
) -> Classes:
    """Return the classes of equal values; the tolerance is estimated if none is given."""
    law = _Law(np.array([0.5, 0.25, 0.25]), scale.tolerances[-1] if tolerance is None else tolerance, len(values))
    for _ in range(ROUNDS):
        of = _grown(values, cov, scale, law)
        law = _learned(values, cov, scale, law, of, tolerance)
    likely = _grown(values, cov, scale, law)
    of = _without(values, cov, scale, law, likely, SURE)
    nearest, probability, _ = _judged(values, cov, scale, law, likely)
    return Classes(of, nearest, np.where(of >= 0, _judged(values, cov, scale, law, of)[1], probability), law.tolerance)


def imposed(
    values: Float[np.ndarray, " n"], H: Float[np.ndarray, "n s"], cov: Float[np.ndarray, "s s"],
    of: Int[np.ndarray, " n"], noise: Float[np.ndarray, "n n"],
) -> tuple[Float[np.ndarray, " s"], Float[np.ndarray, "s s"]]:  # fmt: skip
    """Return the correction of a state once its values are equal class by class, and its covariance then.

    `H` is the derivative of the values by the state, and values of a class lie within half a period of each other. By
    how much they may be off their class is the covariance `noise`. This is one Kalman update, in Joseph's form.
    """
    C = _contrasts(of)
    J, R = C @ H, C @ np.where(of[:, None] == of, noise, 0.0) @ C.T
    K = np.linalg.solve(J @ cov @ J.T + R, J @ cov).T
    rest = np.eye(len(cov)) - K @ J
    conditioned = rest @ cov @ rest.T + K @ R @ K.T
    return -K @ (C @ values), 0.5 * (conditioned + conditioned.T)


def _contrasts(of: Int[np.ndarray, " n"]) -> Float[np.ndarray, "m n"]:
    """Return the matrix that takes the first value of each class from all others of it."""
    firsts = {label: int(np.flatnonzero(of == label)[0]) for label in np.unique(of[of >= 0]).tolist()}
    rows = [row for row in np.flatnonzero(of >= 0).tolist() if firsts[int(of[row])] != row]
    C = np.eye(len(of))[rows]
    C[np.arange(len(rows)), [firsts[int(of[row])] for row in rows]] = -1.0
    return C


def _density(off: np.ndarray, var: np.ndarray) -> np.ndarray:
    return np.asarray(np.exp(-0.5 * off**2 / var) / np.sqrt(2.0 * np.pi * var))


def _askew(off: np.ndarray, var: np.ndarray, scale: Scale) -> np.ndarray:
    return np.asarray(np.mean([_density(off, var + each**2) for each in scale.askew], axis=0))


def _grown(values: np.ndarray, cov: np.ndarray, scale: Scale, law: _Law) -> Int[np.ndarray, " n"]:
    """Return classes that grew from seeds one by one: the surest values join first, as many as there are at most."""
    of, tried = np.full(len(values), ALONE), np.zeros(len(values), dtype=bool)
    pairs = scale.off(values[:, None] - values)
    own = np.diag(cov)
    var = own[:, None] + own - 2.0 * cov + law.tolerance**2
    equal = law.shares[0] * _density(pairs, var + law.tolerance**2)
    other = law.shares[1] * _askew(pairs, var, scale) + law.shares[2] / scale.width
    likely = np.where(np.eye(len(values), dtype=bool), 0.0, equal / (equal + other))
    likely[likely < LIKELY] = 0.0
    while len(free := np.flatnonzero((of == ALONE) & ~tried)):
        support = likely[np.ix_(free, free)].sum(axis=1)
        seed = int(support.argmax())
        if support[seed] < LIKELY:
            break
        tried[free[seed]] = True
        label = int(of.max(initial=ALONE)) + 1
        grown = np.where(np.arange(len(values)) == free[seed], label, ALONE)
        while True:
            _, probability, _ = _judged(values, cov, scale, law, grown, float(support[seed]))
            joining = np.flatnonzero((of == ALONE) & (grown == ALONE) & (probability > LIKELY))
            if not len(joining):
                break
            most = int((grown == label).sum())
            grown[joining[np.argsort(-probability[joining], kind="stable")[:most]]] = label
        of = np.maximum(of, _without(values, cov, scale, law, grown, LIKELY))
    return _without(values, cov, scale, law, of, LIKELY)


def _without(
    values: np.ndarray, cov: np.ndarray, scale: Scale, law: _Law, of: np.ndarray, least: float
) -> Int[np.ndarray, " n"]:
    """Return the classes without the values that are less probable; a quarter of these leaves at a time."""
    of = of.copy()
    while (of >= 0).any():
        probability = np.where(of >= 0, _judged(values, cov, scale, law, of)[1], np.inf)
        unsure = np.flatnonzero(probability < least)
        if not len(unsure):
            break
        of[unsure[np.argsort(probability[unsure], kind="stable")[: len(unsure) // 4 + 1]]] = ALONE
    return of


def _judged(
    values: np.ndarray, cov: np.ndarray, scale: Scale, law: _Law, of: np.ndarray, support: float = 0.0
) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the nearest class of each value, and the probabilities that it is one of it, and that it is askew.

    The last class counts as one of so many values at least (`support`) while it grows.
    """
    nearest, equal, askew = of.copy(), np.zeros(len(values)), np.zeros(len(values))
    mine, others = np.flatnonzero(of >= 0), np.flatnonzero(of == ALONE)
    if not len(mine):
        return nearest, equal, askew
    labels, row, counts = np.unique(of[mine], return_inverse=True, return_counts=True)
    fit = _fitted(values, cov, scale, law.tolerance, of)
    known = counts[row] > 1
    each, near = _posterior(fit.inside, fit.inside_var, counts - np.eye(len(labels))[row], scale, law)
    equal[mine] = np.where(known, each[np.arange(len(mine)), row], 0.0)
    askew[mine] = np.where(known, near, 0.0)
    if len(others):
        weight = np.maximum(counts, np.where(np.arange(len(labels)) == len(labels) - 1, support, 0.0))
        each, askew[others] = _posterior(fit.outside, fit.outside_var, weight, scale, law)
        nearest[others], equal[others] = labels[each.argmax(axis=1)], each.max(axis=1)
    return nearest, equal, askew


def _posterior(
    off: np.ndarray, var: np.ndarray, counts: np.ndarray, scale: Scale, law: _Law
) -> tuple[np.ndarray, np.ndarray]:
    """Return the probability that each value is one of each class, and that it is near any."""
    weight = counts / law.values
    equal = law.shares[0] * weight * _density(off, var + law.tolerance**2)
    near = law.shares[1] * weight * _askew(off, var, scale)
    total = (equal + near).sum(axis=1) + law.shares[2] / scale.width
    return equal / total[:, None], near.sum(axis=1) / total


class _Fit(NamedTuple):
    """Values against classes, with variances that leave out the tolerance of the value itself."""

    inside: Float[np.ndarray, "m k"]
    """How far each value of a class is from what all others say of its class, and about how far from the others."""
    inside_var: Float[np.ndarray, "m k"]
    outside: Float[np.ndarray, "r k"]
    """How far each other value is from each class."""
    outside_var: Float[np.ndarray, "r k"]
    log_density: float
    """Of the values of all classes, which may be anywhere."""


def _fitted(values: np.ndarray, cov: np.ndarray, scale: Scale, tolerance: float, of: np.ndarray) -> _Fit:
    """Fit y = D c + e: classes c by generalised least squares, and values by what is correlated with them."""
    mine, others = np.flatnonzero(of >= 0), np.flatnonzero(of == ALONE)
    _, first, row = np.unique(of[mine], return_index=True, return_inverse=True)
    y = values[mine][first][row] + scale.off(values[mine] - values[mine][first][row])
    D = np.eye(len(first))[row]
    W = np.linalg.inv(cov[np.ix_(mine, mine)] + tolerance**2 * np.eye(len(mine)))
    A = W @ D
    G = np.linalg.inv(D.T @ A)
    Q = W - A @ G @ A.T
    weight = np.maximum(np.diag(Q), TINY)
    cross = cov[np.ix_(others, mine)]
    U = np.eye(len(first)) - (cross @ A)[:, None, :]
    centres = G @ (A.T @ y)
    off = scale.off((values[others] - cross @ (Q @ y))[:, None] - centres)
    var = (np.diag(cov)[others] - np.vecdot(cross, cross @ W))[:, None] + np.einsum("rka,ab,rkb->rk", U, G, U)
    apart_var = np.diag(G)[:, None] + np.diag(G) - 2.0 * G
    inside = scale.off((Q @ y / weight)[:, None] + (centres[:, None] - centres)[row])
    inside_var = np.maximum(1.0 / weight - tolerance**2, 0.0)[:, None] + apart_var[row]
    log_density = 0.5 * (np.linalg.slogdet(W)[1] + np.linalg.slogdet(G)[1] - y @ Q @ y)
    return _Fit(inside, inside_var, off, np.maximum(var, 0.0), float(log_density))


def _learned(
    values: np.ndarray, cov: np.ndarray, scale: Scale, law: _Law, of: np.ndarray, tolerance: float | None
) -> _Law:
    """Return shares by how many values are in classes, near one or neither, and the tolerance by how they scatter."""
    _, equal, askew = _judged(values, cov, scale, law, of)
    counts = np.add(COUNTS, [equal.sum(), askew.sum(), (1.0 - equal - askew).sum()])
    shares = counts / counts.sum()
    if shares[0] > MOST_SHARE:
        shares = np.array([MOST_SHARE, *(1.0 - MOST_SHARE) * shares[1:] / shares[1:].sum()])
    if tolerance is None and (of >= 0).any():
        tried = np.array(scale.tolerances)
        log = np.array([_fitted(values, cov, scale, each, of).log_density for each in tried])
        weight = np.exp(log - log.max()) / np.exp(log - log.max()).sum()
        mean = float(weight @ tried**2)
        spread = float(np.sqrt(weight @ (tried**2 - mean) ** 2))
        law = law._replace(tolerance=min(float(np.sqrt(mean + CAUTION * spread)), scale.tolerances[-1]))
    return law._replace(shares=shares)
