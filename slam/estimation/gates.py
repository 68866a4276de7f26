"""How far off an observation may be: levels of the chi-square distribution."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from scipy.special import gammainc, gammaincinv


@lru_cache(maxsize=256)
def gate_level(probability: float, dof: int) -> float:
    """Return the squared Mahalanobis distance that stays below it with this probability: a chi-square quantile."""
    # As scipy.stats has it, which takes longer to import than all else that this package needs.
    return 2.0 * float(gammaincinv(0.5 * dof, probability))


def mean_inside(probability: float, dof: int) -> float:
    """Return the mean of a chi-square over its degrees of freedom among the values below its level: less than 1."""
    return float(gammainc(0.5 * dof + 1.0, 0.5 * gate_level(probability, dof))) / probability


@lru_cache(maxsize=256)
def pair_levels(probability: float, most: int) -> Float[np.ndarray, " l"]:
    """Return the quantiles for none, one, two, ... and so many observations of a line together, each of two numbers."""
    return np.array([0.0, *(gate_level(probability, 2 * pairs) for pairs in range(1, most + 1))])
