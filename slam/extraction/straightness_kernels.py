"""How far short faces may be from their lines: the loops of `straightness`."""

import math

import numpy as np
from jaxtyping import Float, Int

from ..geometry.compiled import compiled


@compiled
def edge_variance(length_m: float, edge_m: float, face_m: float) -> float:
    """Return the variance of a face of this length across its line, m^2."""
    return (edge_m / (1.0 + (length_m / face_m) ** 4)) ** 2


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


@compiled
def misfit_variances(
    cov: Float[np.ndarray, "s 2 2"], chi2: Float[np.ndarray, " s"], beam_counts: Int[np.ndarray, " s"], sigmas: float
) -> Float[np.ndarray, " s"]:
    """Return how far two faces would be off each line that shows its misfit, as a variance across it, m^2.

    Each of two faces that meet in a corner is off the line through both by twice what their residuals show. What is
    within so many standard errors of the noise counts nothing.
    """
    found = np.zeros(len(cov))
    for k in range(len(cov)):
        dof = beam_counts[k] - 2.0
        if chi2[k] - dof > sigmas * math.sqrt(2.0 * dof):
            found[k] = 4.0 * (chi2[k] - dof) * of_a_beam(cov[k], beam_counts[k]) / beam_counts[k]
    return found


@compiled
def faces_cov(
    lines: Float[np.ndarray, "s 2"],
    ends: Float[np.ndarray, "s 2 2"],
    cov: Float[np.ndarray, "s 2 2"],
    chi2: Float[np.ndarray, " s"],
    beam_counts: Int[np.ndarray, " s"],
    sigmas: float,
    edge_m: float,
    face_m: float,
) -> Float[np.ndarray, "s 2 2"]:
    """Return what the covariances of (alpha, r) of seen lines lack, since some are of several faces."""
    across, lengths = misfit_variances(cov, chi2, beam_counts, sigmas), np.empty(len(lines))
    for k in range(len(lines)):
        lengths[k] = math.hypot(ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1])
        across[k] += edge_variance(lengths[k], edge_m, face_m)
    return edge_cov(across, lengths, middles_of(lines, ends))


@compiled
def middles_of(lines: Float[np.ndarray, "s 2"], ends: Float[np.ndarray, "s 2 2"]) -> Float[np.ndarray, " s"]:
    """Return how far along its line the middle of each segment lies from the foot of the robot."""
    middles = np.empty(len(lines))
    for k in range(len(lines)):
        x, y = 0.5 * (ends[k, 0, 0] + ends[k, 1, 0]), 0.5 * (ends[k, 0, 1] + ends[k, 1, 1])
        middles[k] = y * math.cos(lines[k, 0]) - x * math.sin(lines[k, 0])
    return middles
