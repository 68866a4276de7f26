"""How large a scanner's range noise is, by what its own scans show: the scatter of beams about the lines they make."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from .segments import Segments


def range_noise(segments: Sequence[Segments], assumed_m: float, least_beams: int) -> float | None:
    """Return the standard deviation of a range about straight walls, m, from segments that were cut with another one.

    The median over all beams of what their segments' misfits say: bowed walls and lines over two faces are few. None
    where no segment has so many beams.
    """
    misfits = np.concatenate([each.chi2 for each in segments])
    beams = np.concatenate([each.beam_counts for each in segments])
    enough = beams >= least_beams
    free = beams[enough] - 2
    if not len(free):
        return None
    variances = misfits[enough] / chi2.ppf(0.5, free)
    order = np.argsort(variances)
    middle = np.searchsorted(np.cumsum(free[order]), 0.5 * free.sum())
    return float(assumed_m * np.sqrt(variances[order[middle]]))
