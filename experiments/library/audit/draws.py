"""Normalised errors of a series, and the interval of their mean, although errors last from pose to pose.

The mean of n correlated NEES scatters like that of fewer independent ones. How many is told by the autocorrelation of
the whitened errors w = L^-1 e with P = L L'. Their mean is known to be 0, so none is subtracted, and an error that
lasts as long as the series counts as one draw. The NEES of Gaussian errors of correlation rho are correlated by rho^2:
1/n_i = (1 + 2 sum_k (1 - k/n) rho_i(k)^2) / n for axis i, summed to the first lag at which rho_i is not positive. The
degrees of freedom of the mean are nu = d^2 / sum_i 1/n_i (Satterthwaite), from d for one draw to n d, and the interval
of the ANEES is that of a variance by chi-square: nu ANEES over its quantiles.

A graph states how its errors depend on each other, so that nothing is estimated from the series: with the correlations
K_ij of whitened errors, nu = (n d)^2 / sum_ij |K_ij|^2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.special import gammaincinv

from chainslam.slam.estimation.gates import gate_level

LEVELS = (0.5, 0.9, 0.95, 0.99)
"""Of the regions whose coverage is told."""
LEVEL = 0.95
AT_ONCE = 100
"""Errors whose correlations with all others are computed together."""
MOST = 500
"""Errors whose correlations with all others are computed; of more, an even choice."""
Cross = Callable[[Int[np.ndarray, " k"]], Float[np.ndarray, "n d k d"]]
"""The covariances of all errors with some, given their rows."""


@dataclass(frozen=True)
class Score:
    """How normalised errors compare with 1."""

    count: int
    anees: float
    low: float
    high: float
    """95 % interval of the ANEES."""
    draws: float
    """Effective sample size: how many independent errors have a mean that scatters as much."""
    dof: float
    """Degrees of freedom of the interval."""
    median: float
    """Of the NEES, over that of chi-square: 1 is ideal."""
    covered: tuple[float, ...]
    """Share of errors inside the regions of 50, 90, 95 and 99 %."""


def score(white: Float[np.ndarray, "n d"], dof: float | None = None) -> Score:
    """Return the score of a series of whitened errors in the order of their times; n is at least 1.

    The degrees of freedom of their mean are estimated from the series if they are not known.
    """
    count, d = white.shape
    nees = np.sum(white**2, axis=1)
    dof = effective_dof(white) if dof is None else dof
    low, high = interval(float(nees.mean()) / d, dof)
    inside = tuple(float(np.mean(nees <= gate_level(level, d))) for level in LEVELS)
    median = float(np.median(nees)) / gate_level(0.5, d)
    return Score(count, float(nees.mean()) / d, low, high, dof / d, dof, median, inside)


def interval(anees: float, dof: float) -> tuple[float, float]:
    """Return the 95 % interval of an ANEES with so many degrees of freedom."""
    tails = (0.5 * (1.0 + LEVEL), 0.5 * (1.0 - LEVEL))
    high, low = (2.0 * float(gammaincinv(0.5 * dof, tail)) for tail in tails)
    return anees * dof / high, anees * dof / low if low > 0.0 else float("inf")


def effective_dof(white: Float[np.ndarray, "n d"]) -> float:
    """Return the degrees of freedom of the mean NEES of a series, from d to n d."""
    d = white.shape[1]
    return d * d / sum(_share_of_one_draw(white[:, axis]) for axis in range(d))


def joint_dof(whiten: Float[np.ndarray, "n d d"], cross: Cross) -> float:
    """Return the degrees of freedom of the mean NEES of errors whose covariances with each other are known."""
    (n, d, _), total = whiten.shape, 0.0
    chosen = evenly(n, MOST)
    for part in np.array_split(chosen, -(-len(chosen) // AT_ONCE)):
        K = np.einsum("iab,ibjc,jdc->iajd", whiten, cross(part), whiten[part], optimize=True)
        K[part, :, np.arange(len(part))] = np.eye(d)
        total += float(np.sum(K**2)) * n / len(chosen)
    return float(n * d) ** 2 / total


def pooled_dof(dofs: Sequence[float]) -> float:
    """Return the degrees of freedom of the mean of the ANEES of independent runs."""
    return len(dofs) ** 2 / sum(1.0 / each for each in dofs)


def _share_of_one_draw(w: Float[np.ndarray, " n"]) -> float:
    return min(lasting(w, 2), float(len(w))) / len(w)


def lasting(w: Float[np.ndarray, " n"], power: int) -> float:
    """Return 1 + 2 sum_k (1 - k/n) rho(k)^power of a series, to the first lag at which rho is not positive."""
    n = len(w)
    rho = autocorrelation(w)[1:]
    ends = np.flatnonzero(rho <= 0.0)
    most = int(ends[0]) if len(ends) else n - 1
    return 1.0 + 2.0 * float(np.sum((1.0 - np.arange(1, most + 1) / n) * rho[:most] ** power))


def evenly(count: int, most: int) -> Int[np.ndarray, " k"]:
    """Return so many rows of a series at most, evenly chosen."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def autocorrelation(w: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the correlation of a series of mean 0 with itself k places later, k = 0 to n - 1; 0 where it is none."""
    n = len(w)
    spectrum = np.fft.rfft(w, 2 * n)
    products = np.fft.irfft(np.abs(spectrum) ** 2, 2 * n)[:n]
    sums = np.concatenate([[0.0], np.cumsum(w**2)])
    lags = np.arange(n)
    scale = np.sqrt(sums[n - lags] * (sums[n] - sums[lags]))
    return np.divide(products, scale, out=np.zeros(n), where=scale > 0.0)
