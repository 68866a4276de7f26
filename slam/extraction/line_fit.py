"""Straight lines in inverse range: 1/rho = a cos(theta) + b sin(theta), linear in (a, b).

Bearings are exact and the noise is radial, so this fit is right at any incidence; orthogonal least squares is not.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int


class Beams(NamedTuple):
    """The returns of a scan in counter-clockwise order, all of shape (m,)."""

    cos: Float[np.ndarray, " m"]
    """Cosine of the bearing."""
    sin: Float[np.ndarray, " m"]
    """Sine of the bearing."""
    rho: Float[np.ndarray, " m"]
    """Range m."""


class Fit(NamedTuple):
    """Lines in inverse range with their information, all of shape (n,)."""

    a: Float[np.ndarray, " n"]
    """cos(alpha) / r, 1/m."""
    b: Float[np.ndarray, " n"]
    """sin(alpha) / r, 1/m."""
    cc: Float[np.ndarray, " n"]
    """Information of a."""
    cs: Float[np.ndarray, " n"]
    """Information shared by a and b."""
    ss: Float[np.ndarray, " n"]
    """Information of b."""


def prefix_sums(beams: Beams, sigma_m: Float[np.ndarray, " m"]) -> Float[np.ndarray, "6 m1"]:
    """Return running sums, from 0, of the weighted normal equations, so that any run of beams is fitted in O(1)."""
    rho2 = np.square(beams.rho / sigma_m)
    x, y = beams.rho * beams.cos, beams.rho * beams.sin
    sums = np.zeros((6, len(rho2) + 1))
    terms = np.empty((6, len(rho2)))
    terms[0], terms[1], terms[2] = x * x, x * y, y * y
    terms[3], terms[4], terms[5] = x, y, 1.0
    terms *= rho2
    np.cumsum(terms, axis=1, out=sums[:, 1:])
    return sums


def fit_runs(
    sums: Float[np.ndarray, "6 m1"], start: Int[np.ndarray, "*n"], stop: Int[np.ndarray, "*n"]
) -> tuple[Fit, Float[np.ndarray, "*n"]]:
    """Return the lines through the beams [start, stop) and their chi-squares, which are 0 below 3 beams."""
    cc, cs, ss, xc, xs, qq = sums.take(stop, axis=1) - sums.take(start, axis=1)
    det = cc * ss - cs * cs
    a = (ss * xc - cs * xs) / det
    b = (cc * xs - cs * xc) / det
    chi2 = qq - a * xc - b * xs
    chi2[stop - start <= 2] = 0.0
    return Fit(a, b, cc, cs, ss), chi2


def refit(
    fit: Fit, beams: Beams, line: Int[np.ndarray, " m"], offsets: Int[np.ndarray, " n"], keep: Float[np.ndarray, " m"]
) -> Fit:
    """Return the maximum-likelihood lines near `fit`: one Gauss-Newton step on the ranges.

    `beams` are grouped by `line`, each group starting at `offsets`; `keep` is 1/sigma^2 for beams to use, else 0.
    The derivative of the range p = 1/(a c + b s) is -p^2 (c, s), taken at the prediction: weighting by the measured
    range instead would bias the line towards the robot.
    """
    c, s = beams.cos, beams.sin
    p = 1.0 / (fit.a[line] * c + fit.b[line] * s)
    e = p - beams.rho
    p *= p
    gc, gs = p * c, p * s
    terms = np.empty((5, len(p)))
    np.multiply(gc, gc, out=terms[0])
    np.multiply(gc, gs, out=terms[1])
    np.multiply(gs, gs, out=terms[2])
    np.multiply(gc, e, out=terms[3])
    np.multiply(gs, e, out=terms[4])
    terms *= keep
    cc, cs, ss, xc, xs = np.add.reduceat(terms, offsets, axis=1)
    det = cc * ss - cs * cs
    return Fit(fit.a + (ss * xc - cs * xs) / det, fit.b + (cc * xs - cs * xc) / det, cc, cs, ss)


def polar(fit: Fit) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2 2"]]:
    """Return (alpha rad, r m), r > 0, and their first-order covariance.

    alpha = atan2(b, a), r = 1/h, h^2 = a^2 + b^2; J_alpha = (-b, a)/h^2, J_r = -(a, b)/h^3, C = J C_ab J'.
    """
    a, b = fit.a, fit.b
    det = fit.cc * fit.ss - fit.cs * fit.cs
    caa, cab, cbb = fit.ss / det, -fit.cs / det, fit.cc / det
    a2, ab, b2 = a * a, a * b, b * b
    r2 = 1.0 / (a2 + b2)
    r = np.sqrt(r2)
    r4 = r2 * r2
    lines, cov = np.empty((len(a), 2)), np.empty((len(a), 2, 2))
    lines[:, 0], lines[:, 1] = np.arctan2(b, a), r
    cov[:, 0, 0] = (b2 * caa - 2.0 * ab * cab + a2 * cbb) * r4
    cov[:, 1, 1] = (a2 * caa + 2.0 * ab * cab + b2 * cbb) * (r4 * r2)
    cov[:, 0, 1] = cov[:, 1, 0] = (ab * (caa - cbb) + (b2 - a2) * cab) * (r4 * r)
    return lines, cov


def prediction(
    fit: Fit, cos: Float[np.ndarray, "*n"], sin: Float[np.ndarray, "*n"]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Return the range m at which beams meet their lines, and the variance m^2 that the lines' own error gives it."""
    p = 1.0 / (fit.a * cos + fit.b * sin)
    det = fit.cc * fit.ss - fit.cs * fit.cs
    variance = ((fit.ss * cos - 2.0 * fit.cs * sin) * cos + fit.cc * sin * sin) / det
    return p, np.square(p * p) * variance


def crossing(
    a: Float[np.ndarray, " n"], b: Float[np.ndarray, " n"], cos: Float[np.ndarray, " n"], sin: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return how far past the bearing (cos, sin) two lines that differ by (a, b) cross, rad within a quarter turn."""
    past: np.ndarray = np.arctan((cos * a + sin * b) / (sin * a - cos * b))
    return past
