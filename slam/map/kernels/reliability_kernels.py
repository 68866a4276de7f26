"""The longest pieces that scans saw of walls, and what they say of them: the loops of `reliability`."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...extraction.straightness_kernels import edge_cov, edge_variance, middles_of
from ...geometry.compiled import compiled
from .profile_kernels import faces_off


@compiled
def add_lengths(
    rows: Int[np.ndarray, " m"],
    cov: Float[np.ndarray, "m 2 2"],
    ends: Float[np.ndarray, "m 2 2"],
    longest: Float[np.ndarray, "n 2"],
) -> None:
    """Keep the two longest pieces, m, that scans saw of each wall (row, -1 for none), the shorter first."""
    for k in range(len(rows)):
        if rows[k] >= 0 and cov[k, 0, 0] > 0.0:
            keep_longest(longest[rows[k]], math.hypot(ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1]))


@compiled
def keep_longest(longest: Float[np.ndarray, "2"], length_m: float) -> None:
    """Take one more length into the two longest, in place."""
    longest[0] = max(longest[0], min(longest[1], length_m))
    longest[1] = max(longest[1], length_m)


@compiled
def lack_of_fit(
    lines: Float[np.ndarray, "s 2"],
    ends: Float[np.ndarray, "s 2 2"],
    broken: Float[np.ndarray, "s 5"],
    extents: Float[np.ndarray, "s 2"],
) -> Float[np.ndarray, "s 2 2"]:
    """Return how far the face that each segment shows may be from the line of its wall, of (alpha rad, r m)."""
    misfits_m2, drawn, _ = faces_off(broken, extents)
    return edge_cov(misfits_m2, drawn[:, 1] - drawn[:, 0], middles_of(lines, ends))


@compiled
def off_lines(
    extents: Float[np.ndarray, "n 2"],
    longest: Float[np.ndarray, "n 2"],
    broken: Float[np.ndarray, "n 5"],
    edge_m: float,
    face_m: float,
) -> tuple[Bool[np.ndarray, " n"], Float[np.ndarray, "n 2 2"]]:
    """Return which walls are broken between their ends, and the `off_line_cov` of all."""
    misfits_m2, drawn, crooked = faces_off(broken, extents)
    return crooked, off_line_cov(extents, longest, misfits_m2, drawn, edge_m, face_m)


@compiled
def off_line_cov(
    extents: Float[np.ndarray, "n 2"],
    longest: Float[np.ndarray, "n 2"],
    across: Float[np.ndarray, " n"],
    drawn: Float[np.ndarray, "n 2"],
    edge_m: float,
    face_m: float,
) -> Float[np.ndarray, "n 2 2"]:
    """Return how far each wall may be from its line, as a covariance of (alpha rad, d m) about its anchor.

    A wall counts as long as two scans have seen it; one of which a single scan showed enough, as long as that did. Its
    misfit `across` is of a line over what was `drawn`.
    """
    n = len(extents)
    variances, lengths, middles = np.empty(n), np.empty(n), 0.5 * (extents[:, 0] + extents[:, 1])
    for k in range(n):
        seen_m = longest[k, 0] if longest[k, 0] > 0.0 else longest[k, 1]
        lengths[k] = min(extents[k, 1] - extents[k, 0], seen_m)
        variances[k] = edge_variance(lengths[k], edge_m, face_m)
    of_misfit = edge_cov(across, drawn[:, 1] - drawn[:, 0], 0.5 * (drawn[:, 0] + drawn[:, 1]))
    return edge_cov(variances, lengths, middles) + of_misfit


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
