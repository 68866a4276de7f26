"""How far short faces may be from their lines: the loops of `straightness`."""

import numpy as np
from jaxtyping import Float

from ..geometry.compiled import compiled


@compiled
def edge_cov(
    across_m2: Float[np.ndarray, " n"],
    lengths_m: Float[np.ndarray, " n"],
    middles_m: Float[np.ndarray, " n"],
) -> Float[np.ndarray, "n 2 2"]:
    """Return the covariance of (direction rad, distance m) of lines that are off across themselves by so much.

    It is that of a line through one point of this variance, which may lie anywhere along the wall: 12 / L^2 times as
    much in direction. `middles_m` says how far along the line the wall's middle lies from the point at
    which the distance is taken.
    """
    cov = np.empty((len(across_m2), 2, 2))
    for k in range(len(cov)):
        turn = 12.0 * across_m2[k] / max(lengths_m[k], 1e-3) ** 2
        cov[k, 0, 0], cov[k, 1, 1] = turn, across_m2[k] + turn * middles_m[k] ** 2
        cov[k, 0, 1] = cov[k, 1, 0] = turn * middles_m[k]
    return cov


@compiled
def of_a_beam(cov: Float[np.ndarray, "2 2"], beams: float) -> float:
    """Return the variance m^2 of one of the beams of a fit across its line: as many times that of the whole fit."""
    return (cov[1, 1] - cov[0, 1] ** 2 / cov[0, 0]) * beams
