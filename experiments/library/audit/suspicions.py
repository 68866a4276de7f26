"""Covariances that cannot be right: not positive definite, in other units, in another order, not accumulated.

Matrices that are none are left out and counted. All else is only a hint: nothing is converted.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from chainslam.slam.evaluation.consistency import anees, nees, whitened

from ...usage import UsageError
from ...views.numbers import number
from .geometry.kinds import parts
from .reading.stated import IN_SPACE, Stated, symmetric

DEGREES = float(np.rad2deg(1.0)) ** 2
"""The ratio of variances in degrees and in radians."""
NEAR = 4.0
"""A ratio within this factor of another one is explained by it."""
SMALLEST = 1e-24
"""A variance below it is zero."""
SINGULAR = 1e-10
"""Smallest eigenvalue of the correlations of a covariance that can be inverted."""
USABLE = 0.5
"""Share of covariances below which a file is refused."""
ORDERS_OF_6 = {
    "xx yy tt xy xt yt, the diagonal first": (0, 3, 4, 1, 5, 2),
    "tt xt yt xx xy yy, the heading first": (3, 4, 1, 5, 2, 0),
    "xx xy yy xt yt tt, a lower triangle": (0, 1, 3, 2, 4, 5),
}
"""By name, the column of xx xy xt yy yt tt in other orders of the six."""
ASYMMETRIC = 1e-6
LARGEST = 1e12
"""A variance beyond it, m2 or rad2, says nothing."""


@dataclass(frozen=True)
class Checked:
    """Which covariances can be used, and what is wrong with the others, in words."""

    usable: Bool[np.ndarray, " n"]
    notes: tuple[str, ...]


def check(stated: Stated) -> Checked:
    """Return which covariances are positive definite; raises UsageError where most are not."""
    covs = stated.used_covs
    if covs is None:
        raise UsageError(
            f"expected {stated.name} with covariances, found poses only: append 6 columns xx xy xt yy yt tt of x, y and"
            " heading, which a header calls so, or the 21 of ROS"
        )
    finite = np.all(np.abs(covs) <= LARGEST, axis=(1, 2))  # NaN is not
    zero = finite & np.all(covs == 0.0, axis=(1, 2)) & (np.arange(len(covs)) != stated.held)
    symmetric = np.zeros(len(covs), dtype=bool)
    symmetric[finite] = np.all(
        np.abs(covs[finite] - covs[finite].swapaxes(1, 2))
        <= ASYMMETRIC * np.abs(covs[finite]).max(axis=(1, 2))[:, None, None],
        axis=(1, 2),
    )
    invertible = definite(covs)
    faults = {
        f"NaN or beyond {LARGEST:g}": ~finite,
        "all zero": zero,
        "not symmetric": finite & ~symmetric,
        "not positive definite": finite & ~zero & symmetric & ~invertible & (np.arange(len(covs)) != stated.held),
    }
    usable = finite & symmetric & invertible & ~zero
    notes = []
    for words, wrong in faults.items():
        if np.any(wrong):
            count = int(np.count_nonzero(wrong))
            notes.append(f"{count} of {len(covs)} covariances are {words}, first in row {np.argmax(wrong) + 1}")
    if np.count_nonzero(usable) < USABLE * len(covs):
        hint = order_hint(stated)
        raise UsageError(
            f"expected covariances of {_axes(stated)} in {stated.name}, found that {'; '.join(notes)}:"
            f" {hint or 'correct them'}"
        )
    return Checked(usable, tuple(f"{words}: left out" for words in notes))


def _axes(stated: Stated) -> str:
    return "x y z roll pitch yaw" if stated.poses_world.shape[1] == IN_SPACE else "x, y and heading"


def definite(covs: Float[np.ndarray, "n d d"]) -> Bool[np.ndarray, " n"]:
    """Return which matrices are positive definite, in whatever units their axes are."""
    diagonal = np.einsum("nii->ni", covs)
    good = np.all(np.abs(covs) <= LARGEST, axis=(1, 2)) & np.all(diagonal > SMALLEST, axis=1)
    definite = np.zeros(len(covs), dtype=bool)
    if np.any(good):
        sigmas = np.sqrt(diagonal[good])
        correlations = covs[good] / (sigmas[:, :, None] * sigmas[:, None, :])
        definite[good] = np.linalg.eigvalsh(0.5 * (correlations + correlations.swapaxes(1, 2)))[:, 0] > SINGULAR
    return definite


def other_orders(stated: Stated) -> dict[str, Float[np.ndarray, "n d d"]]:
    """Return, by name, the covariances of the audited axes if the columns were meant in another order."""
    if stated.covs is None:
        return {}
    size = stated.covs.shape[1]
    if size == 6:
        swap = (3, 4, 5, 0, 1, 2)
        turned = stated.covs[:, swap][:, :, swap]
        used = replace(stated, covs=turned).used_covs
        return {} if used is None else {"roll pitch yaw x y z, as GTSAM has it": used}
    upper = np.triu_indices(3)
    cells = stated.covs[:, upper[0], upper[1]]
    return {words: symmetric(cells[:, order], 3) for words, order in ORDERS_OF_6.items()}


def order_hint(stated: Stated, errors: Float[np.ndarray, "n d"] | None = None) -> str:
    """Return in which other order of its columns all covariances would be right; empty if in none.

    Without the errors: in which they are positive definite, where too few are as given. With them: in which position
    and heading are consistent, where they are not as given.
    """
    given = stated.used_covs
    assert given is not None
    is_odd = np.mean(definite(given)) < 0.9
    for words, covs in other_orders(stated).items():
        if np.mean(definite(covs)) < 0.99:
            continue
        if is_odd and np.mean(definite(given)) < USABLE:
            return f"they would be positive definite in the order {words}"
        if errors is not None and not _both_fit(errors, given) and _both_fit(errors, covs):
            return f"they would be consistent in the order {words}"
    return ""


def _both_fit(errors: Float[np.ndarray, "n d"], covs: Float[np.ndarray, "n d d"]) -> bool:
    """Return whether the ANEES of position and of heading are both near 1."""
    rows = definite(covs) & np.all(np.isfinite(errors), axis=1)
    if not np.any(rows):
        return False
    whites = (whitened(errors[rows][:, at], covs[rows][:, at, at]) for at in parts(covs.shape[1]))
    return all(1.0 / NEAR < float(np.mean(white**2)) < NEAR for white in whites)


def hints(errors: Float[np.ndarray, "n d"], covs: Float[np.ndarray, "n d d"]) -> list[str]:
    """Return what the errors tell of units and accumulation of covariances, in words; empty if nothing is odd."""
    found = []
    at = parts(covs.shape[1])
    sigma = float(np.sqrt(np.median(covs[:, at[1], at[1]].diagonal(axis1=1, axis2=2).max(axis=1))))
    position, heading = (whitened(errors[:, part], covs[:, part, part]) for part in at)
    what = "heading" if covs.shape[1] == 3 else "rotation"
    ratio = float(np.mean(heading**2)) / max(float(np.mean(position**2)), 1e-300)
    if DEGREES / NEAR < ratio < DEGREES * NEAR:
        found.append(f"the NEES of the {what} is 57.3² times that of the position: are the {what}s in degrees?")
    elif 1.0 / (DEGREES * NEAR) < ratio < NEAR / DEGREES:
        found.append(f"the NEES of the {what} is 57.3² times smaller than that of the position: is its covariance in"
                     " degrees?")  # fmt: skip
    elif sigma > np.pi:
        found.append(f"the stated sigma of the {what} is {number(sigma)} rad, more than half a turn: in degrees?")
    if _is_constant(covs) and _grows(errors, covs):
        found.append("the covariance is constant while the errors grow: is it that of a step, or of a second?")
    return found


def _is_constant(covs: Float[np.ndarray, "n d d"]) -> bool:
    sizes = np.linalg.det(covs)
    return float(sizes.max()) <= 1.1 * float(sizes.min())


def _grows(errors: Float[np.ndarray, "n d"], covs: Float[np.ndarray, "n d d"]) -> bool:
    """Return whether the errors of the last third are far larger than those of the first, and than stated."""
    third = max(len(errors) // 3, 1)
    first, last = (anees(nees(errors[part], covs[part]), covs.shape[1]) for part in (slice(third), slice(-third, None)))
    return last > NEAR * max(first, 1e-300) and last > NEAR
