"""Sums over the observations of each wall, and what they say of it: the loops of `reliability`."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...extraction.straightness_kernels import edge_cov, edge_variance, of_a_beam
from ...geometry.compiled import compiled
from ...geometry.matrix_kernels import wrapped


@compiled
def add_fits(
    rows: Int[np.ndarray, " m"],
    cov: Float[np.ndarray, "m 2 2"],
    chi2: Float[np.ndarray, " m"],
    beam_counts: Int[np.ndarray, " m"],
    fits: Float[np.ndarray, "n 2"],
    residue: Float[np.ndarray, "n 3"],
) -> None:
    """Add the squared residuals of the fits of one scan, each to the row of its wall."""
    for k in range(len(rows)):
        row, beams, dof = rows[k], beam_counts[k], beam_counts[k] - 2.0
        fits[row, 0] += chi2[k]
        fits[row, 1] += dof
        variance = of_a_beam(cov[k], beams)
        residue[row, 0] += (chi2[k] - dof) * variance
        residue[row, 1] += 2.0 * dof * variance * variance
        residue[row, 2] += beams


@compiled
def add_directions(
    rows: Int[np.ndarray, " m"],
    alpha_world: Float[np.ndarray, " m"],
    cov: Float[np.ndarray, "m 2 2"],
    clear: Bool[np.ndarray, " m"],
    first: Float[np.ndarray, " n"],
    directions: Float[np.ndarray, "n 2 2"],
) -> None:
    """Add the directions that one scan shows, about the first of each wall, each to the vague or the clear ones."""
    new = np.empty(len(rows), np.bool_)
    for k in range(len(rows)):
        new[k] = math.isnan(first[rows[k]])
    for k in range(len(rows)):
        if new[k]:
            first[rows[k]] = wrapped(alpha_world[k])
    for k in range(len(rows)):
        information = 1.0 / cov[k, 0, 0]
        sums = directions[rows[k], 1 if clear[k] else 0]
        sums[0] += information
        sums[1] += information * wrapped(wrapped(alpha_world[k]) - first[rows[k]])


@compiled
def apart(directions: Float[np.ndarray, "2 2"]) -> tuple[float, float]:
    """Return by how much vague and clear directions of a wall differ, and its variance; 0 and inf without either."""
    vague, clear = directions[0], directions[1]
    if not (vague[0] > 0.0 and clear[0] > 0.0):
        return 0.0, math.inf
    return clear[1] / clear[0] - vague[1] / vague[0], 1.0 / vague[0] + 1.0 / clear[0]


@compiled
def in_conflict(directions: Float[np.ndarray, "n 2 2"], level: float) -> Bool[np.ndarray, " n"]:
    """Return of which walls vague and clear directions differ by more than a level of chi-square."""
    conflict = np.empty(len(directions), np.bool_)
    for k in range(len(directions)):
        difference, variance = apart(directions[k])
        conflict[k] = difference * difference > level * variance
    return conflict


@compiled
def misfits(
    residue: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 2 2"], noise_sigmas: float
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return how far faces of walls are off their line: variances in m^2 across it and in rad^2.

    Of two faces that meet in a corner each is off the line through both by twice what their residuals show; where
    what is vague and what is clear disagree, the clear ones have moved the line to where the others are not. What is
    within so many standard errors of the noise counts nothing.
    """
    across, turned = np.zeros(len(residue)), np.zeros(len(residue))
    for k in range(len(residue)):
        if residue[k, 0] > noise_sigmas * math.sqrt(residue[k, 1]):
            across[k] = 4.0 * residue[k, 0] / residue[k, 2]
        difference, variance = apart(directions[k])
        if difference * difference > noise_sigmas**2 * variance:
            turned[k] = difference * difference
    return across, turned


@compiled
def off_line_cov(
    extents: Float[np.ndarray, "n 2"],
    across: Float[np.ndarray, " n"],
    turned: Float[np.ndarray, " n"],
    edge_m: float,
    face_m: float,
) -> Float[np.ndarray, "n 2 2"]:
    """Return how far each wall may be from its line, as a covariance of (alpha rad, d m) about its anchor."""
    n = len(extents)
    variances, lengths, middles = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        lengths[k] = extents[k, 1] - extents[k, 0]
        middles[k] = 0.5 * (extents[k, 0] + extents[k, 1])
        variances[k] = across[k] + edge_variance(lengths[k], edge_m, face_m)
    return edge_cov(variances, lengths, middles, turned)


@compiled
def may_move(
    is_tentative: Bool[np.ndarray, " s"],
    cov: Float[np.ndarray, "s 2 2"],
    clear: Bool[np.ndarray, " s"],
    rows: Int[np.ndarray, " s"],
    crooked: Bool[np.ndarray, " n"],
    directions: Float[np.ndarray, "n 2 2"],
    few_heading_rad: float,
) -> Bool[np.ndarray, " s"]:
    """Return which segments, each on the wall of its row, may move the estimate (`Reliability.may_move`)."""
    straight, any_is = np.zeros(len(rows), np.bool_), False
    for k in range(len(rows)):
        few = is_tentative[k] and cov[k, 0, 0] < few_heading_rad**2
        few = few and directions[rows[k], 1, 0] * cov[k, 0, 0] > 1.0
        straight[k] = (clear[k] or few) and not crooked[rows[k]]
        any_is = any_is or straight[k]
    return straight if any_is else clear


@compiled
def as_told(
    cov: Float[np.ndarray, "m 2 2"], is_tentative: Bool[np.ndarray, " m"], heading_rad: float
) -> Float[np.ndarray, "m 2 2"]:
    """Return the covariances of (alpha, r) of observations that move the estimate (`reliability.as_told`)."""
    told = cov.copy()
    if is_tentative.all():
        return told
    for k in range(len(cov)):
        turn = heading_rad if is_tentative[k] else 0.0
        lever = turn * cov[k, 1, 0] / cov[k, 0, 0]
        told[k, 0, 0] += turn * turn
        told[k, 0, 1] += turn * lever
        told[k, 1, 0] += turn * lever
        told[k, 1, 1] += lever * lever
    return told
