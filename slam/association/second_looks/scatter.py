"""How far the sightings of walls scatter about them, and how much of that neighbouring sightings have in common.

What a segment states is the noise of its beams. Real walls also bow, and have panels, doors and cupboards: two scans
from nearly the same place see the same of it, and are off by the same. Both are estimated from each drive itself.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.optimize import brentq

from .config import SecondLooksConfig
from .landmarks import Sightings
from .solve import Unknowns, of_sightings

LEAST = 30
"""From fewer errors, or pairs of errors, nothing is estimated."""
NORMAL = np.linspace(-8.0, 8.0, 4001)
"""Where the normal density is summed up."""


@dataclass(frozen=True)
class Scatter:
    """The scatter of one kind of error beyond what sightings state, and how often one error is counted."""

    floor: float
    """Standard deviation that is added to the stated one."""
    shared: float
    """Number of successive sightings of a wall that err together: their information is that of one."""


def as_scattered(
    at: Unknowns, sightings: Sightings, owner: Int[np.ndarray, " n"], config: SecondLooksConfig
) -> tuple[Sightings, SecondLooksConfig]:
    """Return sightings and settings whose variances are those of the errors at a solution.

    Directions and offsets are told apart. Of fewer errors than `LEAST` nothing is known, and all stays as it is.
    """
    if len(sightings) < LEAST:
        return sightings, config
    stated = np.column_stack([sightings.sigma_rad, sightings.sigma_m])
    errors = of_sightings(at, sightings, owner, config).errors
    errors *= np.hypot(stated, [config.floor_rad, config.floor_m])
    order = np.lexsort((sightings.scan, owner))
    angle, offset = (
        scatter(errors[order, k], stated[order, k], owner[order], config.doubt) for k in range(stated.shape[1])
    )
    times = np.sqrt([angle.shared, offset.shared])
    scattered = replace(sightings, sigma_rad=times[0] * sightings.sigma_rad, sigma_m=times[1] * sightings.sigma_m)
    return scattered, replace(config, floor_rad=times[0] * angle.floor, floor_m=times[1] * offset.floor)


def scatter(
    errors: Float[np.ndarray, " n"], stated: Float[np.ndarray, " n"], owner: Int[np.ndarray, " n"], doubt: float
) -> Scatter:
    """Return the scatter of errors, those of each wall side by side and in the order of their scans.

    Large errors count as little as in the solution (Cauchy's weight, from `doubt` standard deviations on).
    """
    floor = _floor(errors, stated, doubt)
    whitened = errors / np.hypot(stated, floor)
    return Scatter(floor, _shared(whitened / np.sqrt(1.0 + (whitened / doubt) ** 2), owner))


def _floor(errors: Float[np.ndarray, " n"], stated: Float[np.ndarray, " n"], doubt: float) -> float:
    """Return what is to be added to the stated deviations, so that errors are as large as normal ones would be."""
    normal = np.exp(-0.5 * NORMAL**2)
    expected = float(np.average(_bounded(NORMAL, doubt), weights=normal))

    def excess(floor: float) -> float:
        return float(np.mean(_bounded(errors / np.hypot(stated, floor), doubt))) - expected

    if excess(0.0) <= 0.0:
        return 0.0
    return float(brentq(excess, 0.0, float(np.abs(errors).max() / np.sqrt(expected))))


def _bounded(errors: Float[np.ndarray, " n"], doubt: float) -> Float[np.ndarray, " n"]:
    """Return squared errors, none above `doubt` squared."""
    return errors**2 / (1.0 + (errors / doubt) ** 2)


def _shared(errors: Float[np.ndarray, " n"], owner: Int[np.ndarray, " n"]) -> float:
    """Return the variance of a mean of errors over that of independent ones: 1 + 2 (r_1 + r_2 + ...).

    r_k is the correlation of a wall's errors k sightings apart; the sum ends before the first that is not positive,
    since noise is all that follows.
    """
    variance, total = float(np.mean(errors**2)), 1.0
    for lag in range(1, len(errors)):
        same = owner[lag:] == owner[:-lag]
        if np.count_nonzero(same) < LEAST:
            break
        together = float(np.mean((errors[lag:] * errors[:-lag])[same]))
        if together <= 0.0:
            break
        total += 2.0 * together / variance
    return total
