"""How far off an observation may be: levels of the chi-square distribution."""

from functools import lru_cache

from scipy.special import gammaincinv


@lru_cache(maxsize=256)
def gate_level(probability: float, dof: int) -> float:
    """Return the squared Mahalanobis distance that stays below it with this probability: a chi-square quantile."""
    # As scipy.stats has it, which takes longer to import than all else that this package needs.
    return 2.0 * float(gammaincinv(0.5 * dof, probability))
