"""The pieces of a scan fitted to their returns: trimmed at free ends, rid of outliers, and fitted again."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled
from .joint_kernels import Joints
from .line_kernels import Line, line_of, met_at, put, refit, variance_met
from .returns_kernels import Returns, Rules


class Fitted(NamedTuple):
    """Lines through returns of a scan, counter-clockwise."""

    lines: Float[np.ndarray, "n 5"]
    """Rows of `Line`."""
    place: Int[np.ndarray, "n 2"]
    """The first and the last return that each fit used; in a ring they may pass the ends."""
    counts: Int[np.ndarray, " n"]
    """How many it used."""
    chi2: Float[np.ndarray, " n"]


@compiled
def fitted(joints: Joints, returns: Returns, rules: Rules) -> Fitted:
    """Return the pieces that keep `least_beams` returns, with their lines."""
    n = len(joints.pieces)
    lines, place, counts, chi2 = np.empty((n, 5)), np.empty((n, 2), np.int64), np.empty(n, np.int64), np.empty(n)
    kept = 0
    for k in range(n):
        line, first, last, count, squares = _fitted_piece(k, joints, returns, rules)
        if count >= rules.least_beams and np.isfinite(line.a + line.b):
            put(lines, kept, line)
            place[kept, 0], place[kept, 1], counts[kept], chi2[kept] = first, last, count, squares
            kept += 1
    return Fitted(lines[:kept], place[:kept], counts[:kept], chi2[:kept])


@compiled
def _fitted_piece(k: int, joints: Joints, returns: Returns, rules: Rules) -> tuple[Line, int, int, int, float]:
    """Return a piece's line, its first and last return, how many it used, and their chi-square; too few give 0."""
    line = line_of(joints.lines, k)
    start, stop = joints.pieces[k, 0], joints.pieces[k, 1]
    if stop - start < rules.least_beams:
        return line, start, stop, 0, 0.0
    is_long = stop - start - 2 >= rules.least_beams
    if is_long and (joints.in_doubt[k, 0] or not joints.is_corner[k, 0]):
        start += 1
    if is_long and (joints.in_doubt[k, 1] or not joints.is_corner[k, 1]):
        stop -= 1
    size, m = stop - start, len(returns.beam)
    cos, sin, ranges, sigmas = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    for i in range(size):
        at = (start + i) % m
        cos[i], sin[i], ranges[i], sigmas[i] = (
            returns.cos[at],
            returns.sin[at],
            returns.ranges_m[at],
            returns.sigmas_m[at],
        )
    line = refit(line, cos, sin, ranges, 1.0 / _variances(line, cos, sin, ranges, sigmas, returns.sigma_share))
    sigma2 = _variances(line, cos, sin, ranges, sigmas, returns.sigma_share)
    keep = 1.0 / sigma2
    for i in range(size):
        is_free = (i == 0 and not joints.is_corner[k, 0]) or (i == size - 1 and not joints.is_corner[k, 1])
        gate = rules.outlier_sigmas if is_free else rules.noise_sigmas
        off = met_at(line, cos[i], sin[i]) - ranges[i]
        # A residual varies by sigma^2 less what its own beam lent to the line; a beam that alone holds the line stays.
        spread = max(sigma2[i] - variance_met(line, cos[i], sin[i]), 1e-6 * sigma2[i])
        if not off * off <= gate * gate * spread:
            keep[i] = 0.0
        elif is_free and not is_long:
            keep[i] *= rules.end_share
    line = refit(line, cos, sin, ranges, keep)
    first, last, count, chi2 = stop, start, 0, 0.0
    for i in range(size):
        if keep[i] > 0.0:
            first, last, count = min(first, start + i), start + i, count + 1
            chi2 += (met_at(line, cos[i], sin[i]) - ranges[i]) ** 2 / sigma2[i]
    return line, first, last, count, chi2


@compiled
def _variances(
    line: Line,
    cos: Float[np.ndarray, " m"],
    sin: Float[np.ndarray, " m"],
    ranges_m: Float[np.ndarray, " m"],
    sigmas_m: Float[np.ndarray, " m"],
    share: float,
) -> Float[np.ndarray, " m"]:
    """Return the variances m^2 of ranges, where noise grows with the range that of the range at which a line is met.

    The measured range would give more weight to beams that fell short by chance, and bias the line towards the robot.
    """
    sigma2 = sigmas_m**2
    if share > 0.0:
        for i in range(len(sigma2)):
            grown = share**2 * (met_at(line, cos[i], sin[i]) ** 2 - ranges_m[i] ** 2)
            if np.isfinite(grown):
                sigma2[i] = max(sigma2[i] + grown, 0.25 * sigma2[i])
    return sigma2
