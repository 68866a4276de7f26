"""Straight lines in inverse range: 1/rho = a cos(theta) + b sin(theta), linear in (a, b).

Bearings are exact and the noise is radial, so this fit is right at any incidence; orthogonal least squares is not.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...geometry.compiled import compiled


class Line(NamedTuple):
    """A line in inverse range with its information."""

    a: float
    """cos(alpha) / r, 1/m."""
    b: float
    """sin(alpha) / r, 1/m."""
    cc: float
    """Information of a."""
    cs: float
    """Information shared by a and b."""
    ss: float
    """Information of b."""


@compiled
def line_of(rows: Float[np.ndarray, "n 5"], k: int) -> Line:
    """Return one of many lines."""
    return Line(rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3], rows[k, 4])


@compiled
def put(rows: Float[np.ndarray, "n 5"], k: int, line: Line) -> None:
    """Put a line among many."""
    rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3], rows[k, 4] = line.a, line.b, line.cc, line.cs, line.ss


@compiled
def prefix_sums(
    cos: Float[np.ndarray, " m"],
    sin: Float[np.ndarray, " m"],
    ranges_m: Float[np.ndarray, " m"],
    sigmas_m: Float[np.ndarray, " m"],
) -> Float[np.ndarray, "m1 6"]:
    """Return running sums, from 0, of the weighted normal equations, so that any run of beams is fitted in O(1)."""
    sums = np.zeros((len(ranges_m) + 1, 6))
    for i in range(len(ranges_m)):
        rho2 = (ranges_m[i] / sigmas_m[i]) ** 2
        x, y = ranges_m[i] * cos[i], ranges_m[i] * sin[i]
        sums[i + 1, 0] = sums[i, 0] + x * x * rho2
        sums[i + 1, 1] = sums[i, 1] + x * y * rho2
        sums[i + 1, 2] = sums[i, 2] + y * y * rho2
        sums[i + 1, 3] = sums[i, 3] + x * rho2
        sums[i + 1, 4] = sums[i, 4] + y * rho2
        sums[i + 1, 5] = sums[i, 5] + rho2
    return sums


@compiled
def fit_run(sums: Float[np.ndarray, "m1 6"], start: int, stop: int) -> tuple[Line, float]:
    """Return the line through the beams [start, stop) and its chi-square, which is 0 below 3 beams."""
    cc, cs, ss = sums[stop, 0] - sums[start, 0], sums[stop, 1] - sums[start, 1], sums[stop, 2] - sums[start, 2]
    xc, xs, qq = sums[stop, 3] - sums[start, 3], sums[stop, 4] - sums[start, 4], sums[stop, 5] - sums[start, 5]
    det = cc * ss - cs * cs
    a = (ss * xc - cs * xs) / det
    b = (cc * xs - cs * xc) / det
    chi2 = qq - a * xc - b * xs if stop - start > 2 else 0.0
    return Line(a, b, cc, cs, ss), chi2


@compiled
def chi2_of_run(sums: Float[np.ndarray, "m1 6"], start: int, stop: int) -> float:
    """Return the chi-square of the line through the beams [start, stop)."""
    return fit_run(sums, start, stop)[1]


@compiled
def refit(
    line: Line,
    cos: Float[np.ndarray, " m"],
    sin: Float[np.ndarray, " m"],
    ranges_m: Float[np.ndarray, " m"],
    keep: Float[np.ndarray, " m"],
) -> Line:
    """Return the maximum-likelihood line near another: one Gauss-Newton step on the ranges of its beams.

    `keep` is 1/sigma^2 for beams to use, else 0. The derivative of the range p = 1/(a c + b s) is -p^2 (c, s), taken at
    the prediction: weighting by the measured range instead would bias the line towards the robot.
    """
    cc, cs, ss, xc, xs = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(ranges_m)):
        p = 1.0 / (line.a * cos[i] + line.b * sin[i])
        e = p - ranges_m[i]
        gc, gs = p * p * cos[i], p * p * sin[i]
        cc += gc * gc * keep[i]
        cs += gc * gs * keep[i]
        ss += gs * gs * keep[i]
        xc += gc * e * keep[i]
        xs += gs * e * keep[i]
    det = cc * ss - cs * cs
    return Line(line.a + (ss * xc - cs * xs) / det, line.b + (cc * xs - cs * xc) / det, cc, cs, ss)


@compiled
def polar_cov(line: Line, caa: float, cab: float, cbb: float) -> tuple[float, float, float]:
    """Return a covariance of (a, b) as one of (alpha, r), to first order: of alpha, of both, of r.

    alpha = atan2(b, a), r = 1/h, h^2 = a^2 + b^2; J_alpha = (-b, a)/h^2, J_r = -(a, b)/h^3, C = J C_ab J'.
    """
    a2, ab, b2 = line.a * line.a, line.a * line.b, line.b * line.b
    r2 = 1.0 / (a2 + b2)
    r4 = r2 * r2
    c_alpha = (b2 * caa - 2.0 * ab * cab + a2 * cbb) * r4
    c_both = (ab * (caa - cbb) + (b2 - a2) * cab) * (r4 * np.sqrt(r2))
    c_r = (a2 * caa + 2.0 * ab * cab + b2 * cbb) * (r4 * r2)
    return c_alpha, c_both, c_r


@compiled
def polar(line: Line) -> tuple[float, float, float, float, float]:
    """Return (alpha rad, r m), r > 0, and their first-order variances and covariance: of alpha, of both, of r."""
    det = line.cc * line.ss - line.cs * line.cs
    c_alpha, c_both, c_r = polar_cov(line, line.ss / det, -line.cs / det, line.cc / det)
    return np.arctan2(line.b, line.a), np.sqrt(1.0 / (line.a * line.a + line.b * line.b)), c_alpha, c_both, c_r


@compiled
def met_at(line: Line, cos: float, sin: float) -> float:
    """Return the range m at which a beam meets a line."""
    return 1.0 / (line.a * cos + line.b * sin)


@compiled
def variance_met(line: Line, cos: float, sin: float) -> float:
    """Return the variance m^2 that a line's own error gives the range at which a beam meets it."""
    p = met_at(line, cos, sin)
    det = line.cc * line.ss - line.cs * line.cs
    variance = ((line.ss * cos - 2.0 * line.cs * sin) * cos + line.cc * sin * sin) / det
    return (p * p) ** 2 * variance


@compiled
def crossing(one: Line, other: Line, cos: float, sin: float) -> float:
    """Return how far past the bearing (cos, sin) two lines cross, rad within a quarter turn."""
    a, b = one.a - other.a, one.b - other.b
    return np.arctan((cos * a + sin * b) / (sin * a - cos * b))
