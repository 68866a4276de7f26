"""Sums over the observations of each wall, and what they say of it: the loops of `reliability`."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...extraction.straightness_kernels import edge_cov, of_a_beam
from ...geometry.compiled import compiled


@compiled
def add_fits(
    rows: Int[np.ndarray, " m"],
    cov: Float[np.ndarray, "m 2 2"],
    chi2: Float[np.ndarray, " m"],
    beam_counts: Int[np.ndarray, " m"],
    residue: Float[np.ndarray, "n 3"],
) -> None:
    """Add the squared residuals of the fits of one scan, each to the row of its wall."""
    for k in range(len(rows)):
        row, beams, dof = rows[k], beam_counts[k], beam_counts[k] - 2.0
        variance = of_a_beam(cov[k], beams)
        residue[row, 0] += (chi2[k] - dof) * variance
        residue[row, 1] += 2.0 * dof * variance * variance
        residue[row, 2] += beams


@compiled
def add_lengths(
    rows: Int[np.ndarray, " m"],
    ends: Float[np.ndarray, "m 2 2"],
    longest: Float[np.ndarray, "n 2"],
) -> None:
    """Keep the two longest pieces, m, that scans saw of each wall, the shorter first."""
    for k in range(len(rows)):
        keep_longest(longest[rows[k]], math.hypot(ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1]))


@compiled
def keep_longest(longest: Float[np.ndarray, "2"], length_m: float) -> None:
    """Take one more length into the two longest, in place."""
    longest[0] = max(longest[0], min(longest[1], length_m))
    longest[1] = max(longest[1], length_m)


@compiled
def add_faces(
    rows: Int[np.ndarray, " m"],
    faces_cov: Float[np.ndarray, "m 2 2"],
    middles_m: Float[np.ndarray, " m"],
    faces: Float[np.ndarray, "n 2 2"],
) -> None:
    """Keep the two least variances of each wall that its segments have since they may be of two faces.

    Rows of (turn rad^2, across m^2 at the middle of what was seen), the least first.
    """
    for k in range(len(rows)):
        C, middle = faces_cov[k], middles_m[k]
        keep_least(faces[rows[k]], C[0, 0], C[1, 1] - 2.0 * middle * C[0, 1] + middle**2 * C[0, 0])


@compiled
def keep_least(least: Float[np.ndarray, "2 2"], turn: float, across: float) -> None:
    """Take one more pair of variances into the two least of either, in place."""
    for column, value in enumerate((turn, across)):
        least[1, column] = min(least[1, column], max(least[0, column], value))
        least[0, column] = min(least[0, column], value)


@compiled
def misfits(residue: Float[np.ndarray, "n 3"], noise_sigmas: float) -> Float[np.ndarray, " n"]:
    """Return how far faces of walls are off their line, as variances across it, m^2.

    Of two faces that meet in a corner each is off the line through both by twice what their residuals show. What is
    within so many standard errors of the noise counts nothing.
    """
    across = np.zeros(len(residue))
    for k in range(len(residue)):
        if residue[k, 0] > noise_sigmas * math.sqrt(residue[k, 1]):
            across[k] = 4.0 * residue[k, 0] / residue[k, 2]
    return across


@compiled
def off_line_cov(
    extents: Float[np.ndarray, "n 2"],
    longest: Float[np.ndarray, "n 2"],
    across: Float[np.ndarray, " n"],
    faces: Float[np.ndarray, "n 2 2"],
    face_m: float,
) -> Float[np.ndarray, "n 2 2"]:
    """Return how far each wall may be from its line, as a covariance of (alpha rad, d m) about its anchor.

    A wall counts as long as two scans have seen it; one of which a single scan showed enough, as long as that did. Of a
    short wall every scan sees the same faces beside it, of a longer one those where its view ends: what scans lack
    stays by the same odds by which they lack it.
    """
    n = len(extents)
    variances, lengths, middles = np.empty(n), np.empty(n), np.empty(n)
    for k in range(n):
        seen_m = longest[k, 0] if longest[k, 0] > 0.0 else longest[k, 1]
        lengths[k] = min(extents[k, 1] - extents[k, 0], seen_m)
        middles[k] = 0.5 * (extents[k, 0] + extents[k, 1])
        variances[k] = across[k]
    cov = edge_cov(variances, lengths, middles)
    for k in range(n):
        seen = 1 if np.isfinite(faces[k, 1, 0]) else 0
        if np.isfinite(faces[k, 0, 0]):
            stays = face_m / (face_m + lengths[k])
            turn = stays * faces[k, seen, 0]
            cov[k, 0, 0] += turn
            cov[k, 0, 1] += turn * middles[k]
            cov[k, 1, 0] += turn * middles[k]
            cov[k, 1, 1] += stays * faces[k, seen, 1] + turn * middles[k] ** 2
    return cov


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
