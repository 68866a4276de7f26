"""Where arithmetic ends: these numbers guard it, and decide about no wall and no way."""

TINY = 1e-9
"""Lengths m, turns rad and shares below this are rounding errors: nothing is divided by less."""
LEAST_SIGMA = 1e-6
"""Nothing is known better, m and rad: a thousandth of a millimetre keeps a covariance invertible."""
