"""NEES along the path over many runs: medians, and the band of a consistent estimator."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import betaincinv, chdtri

DOF = 3
POINTS = 61
LEVEL = 0.95


@dataclass(frozen=True)
class AlongPath:
    """The NEES of the pose of one estimator at some path lengths."""

    path_m: Float[np.ndarray, " p"]
    median: Float[np.ndarray, " p"]
    """Median over the runs that last this long; NaN if none of them has a NEES."""
    quartiles: Float[np.ndarray, "2 p"]
    band: Float[np.ndarray, "2 p"]
    """95 % band of the median over as many runs of a consistent estimator."""


def along_path(runs: Sequence[tuple[Float[np.ndarray, " _"], Float[np.ndarray, " _"]]]) -> AlongPath | None:
    """Return the NEES along the path of some runs, each given by its path lengths (s,) m and its NEES (s,).

    It ends where fewer than half of the runs last; None where there is no run, or none that moves.
    """
    lengths = sorted((float(path_m[-1]) if len(path_m) else 0.0 for path_m, _ in runs), reverse=True)
    if not lengths or not (end := lengths[(len(lengths) - 1) // 2]):
        return None
    path = np.linspace(end / (POINTS - 1), end, POINTS - 1)
    values = np.array([_at(path, path_m, nees) for path_m, nees in runs if len(path_m)])
    counts = np.sum(np.isfinite(values), axis=0)
    quarter, median, three_quarters = _quantiles(values, counts)
    half = 0.5 * (np.maximum(counts, 1) + 1.0)
    # The median of n draws is the (n + 1)/2-th smallest, whose rank is beta distributed.
    band = [chdtri(DOF, 1.0 - betaincinv(half, half, level)) for level in (0.5 * (1 - LEVEL), 0.5 * (1 + LEVEL))]
    return AlongPath(path, median, np.array([quarter, three_quarters]), np.array(band))


def _at(
    path: Float[np.ndarray, " p"], path_m: Float[np.ndarray, " _"], nees: Float[np.ndarray, " _"]
) -> Float[np.ndarray, " p"]:
    """Return the NEES at the last step before each path length; NaN beyond the end of the run."""
    rows = np.searchsorted(path_m, path, side="right") - 1
    return np.where(path <= path_m[-1], nees[np.maximum(rows, 0)], np.nan)


def _quantiles(values: Float[np.ndarray, "n p"], counts: np.ndarray) -> Float[np.ndarray, "3 p"]:
    found = np.full((3, values.shape[1]), np.nan)
    found[:, counts > 0] = np.nanquantile(values[:, counts > 0], (0.25, 0.5, 0.75), axis=0)
    return found
