"""What the covariance of a fit lacks since returns may be another face's: a mean over which are, by Bayes' rule.

Hypotheses are that none are, up to two at either end, or all from a bend on; those on either side of a bend lie on a
line of their own. An end is over another face as likely as a face of `face_m` is seen beside one so long; two
returns there, or some where the next beam tells that the surface goes on or is hidden, are as rare as two such chances.
Another face's return lies anywhere within `outlier_sigmas` of what the others predict, else it had been left out. The
mean is of the covariances, with the spread of the estimates about that of all returns (Hoeting et al., "Bayesian model
averaging", Statistical Science 1999).
"""

import numpy as np
from jaxtyping import Float

from ...geometry.compiled import compiled
from .line_kernels import Line, met_at, variance_met
from .returns_kernels import Returns, Rules


@compiled
def odds_of_other_faces(line: Line, first: int, last: int, returns: Returns, rules: Rules) -> Float[np.ndarray, "2"]:
    """Return the odds that the first and the last return of a line are another face's."""
    m = len(returns.beam)
    x, y = np.empty(2), np.empty(2)
    for end, place in enumerate((first % m, last % m)):
        range_m = met_at(line, returns.cos[place], returns.sin[place])
        x[end], y[end] = range_m * returns.cos[place], range_m * returns.sin[place]
    odds = rules.face_m / (rules.face_m + np.hypot(x[1] - x[0], y[1] - y[0]))
    told = np.empty(2)
    told[0] = odds if _looks_past(line, first, -1, returns, rules) else odds * odds
    told[1] = odds if _looks_past(line, last, 1, returns, rules) else odds * odds
    return told


@compiled
def _looks_past(line: Line, last: int, step: int, returns: Returns, rules: Rules) -> bool:
    """Return whether the beam next to the outer return `last` met nothing, or something behind the line."""
    m = len(returns.beam)
    at = (last + step) % m
    steps = returns.beam[at] - returns.beam[last % m] - step
    if steps != 0 and (returns.period == 0 or steps % returns.period != 0):
        return True
    met_m = met_at(line, returns.cos[at], returns.sin[at])
    if not met_m > 0.0:
        return False
    variance = returns.sigmas_m[at] ** 2 + variance_met(line, returns.cos[at], returns.sin[at])
    return returns.ranges_m[at] - met_m > rules.outlier_sigmas * np.sqrt(variance)


@compiled
def spread_over_faces(
    line: Line,
    cos: Float[np.ndarray, " m"],
    sin: Float[np.ndarray, " m"],
    ranges_m: Float[np.ndarray, " m"],
    keep: Float[np.ndarray, " m"],
    odds: Float[np.ndarray, "2"],
    outlier_sigmas: float,
) -> Float[np.ndarray, "3"]:
    """Return what the covariance of (a, b) lacks: of a, of both, of b.

    `keep` is 1/sigma^2 of the returns that the fit used, else 0; `odds` are those of another face's return at either
    end.
    """
    sums = _sums_about(line, cos, sin, ranges_m, keep)
    n, factor = len(sums) - 1, np.sqrt(2.0 * np.pi) / (2.0 * outlier_sigmas)
    chi2 = _rest(sums, 0, n)
    total, mean = 1.0, np.zeros(3)
    for i in range(3):
        for j in range(3):
            if i + j == 0 or n - i - j < 2:
                continue
            weight = odds[0] ** i * odds[1] ** j * factor ** (i + j)
            total += _add(mean, weight * np.exp(0.5 * (chi2 - _rest(sums, i, n - j))), sums, i, n - j)
    for at in range(3, n - 2):
        # Two returns next to the bend may lie anywhere, the line through them predicts the others of their side.
        saved = np.exp(0.5 * (chi2 - _rest(sums, 0, at) - _rest(sums, at, n))) * factor**2
        told = saved * np.sqrt(_det(sums, 0, n) / (_det(sums, 0, at) * _det(sums, at, n)))
        if 2 * at <= n:
            pair = _det(sums, at - 2, at) * _det(sums, at, n) / _det(sums, at - 2, n)
            total += _add(mean, odds[0] ** 2 * told * np.sqrt(pair), sums, at, n)
        if 2 * at >= n:
            pair = _det(sums, at, at + 2) * _det(sums, 0, at) / _det(sums, 0, at + 2)
            total += _add(mean, odds[1] ** 2 * told * np.sqrt(pair), sums, 0, at)
    return mean / total


@compiled
def _sums_about(
    line: Line,
    cos: Float[np.ndarray, " m"],
    sin: Float[np.ndarray, " m"],
    ranges_m: Float[np.ndarray, " m"],
    keep: Float[np.ndarray, " m"],
) -> Float[np.ndarray, "n1 6"]:
    """Return running sums, from 0, of the normal equations of what is to be added to (a, b), of the returns used."""
    sums, n = np.zeros((len(keep) + 1, 6)), 0
    for i in range(len(keep)):
        if keep[i] <= 0.0:
            continue
        p = met_at(line, cos[i], sin[i])
        gc, gs, e = -p * p * cos[i], -p * p * sin[i], ranges_m[i] - p
        sums[n + 1] = sums[n] + keep[i] * np.array([gc * gc, gc * gs, gs * gs, gc * e, gs * e, e * e])
        n += 1
    return sums[: n + 1]


@compiled
def _det(sums: Float[np.ndarray, "n1 6"], start: int, stop: int) -> float:
    """Return the determinant of the information of the returns [start, stop)."""
    cc, cs, ss = sums[stop, 0] - sums[start, 0], sums[stop, 1] - sums[start, 1], sums[stop, 2] - sums[start, 2]
    return cc * ss - cs * cs


@compiled
def _rest(sums: Float[np.ndarray, "n1 6"], start: int, stop: int) -> float:
    """Return the chi-square of the line through the returns [start, stop)."""
    s = sums[stop] - sums[start]
    return s[5] - (s[2] * s[3] * s[3] - 2.0 * s[1] * s[3] * s[4] + s[0] * s[4] * s[4]) / (s[0] * s[2] - s[1] * s[1])


@compiled
def _add(mean: Float[np.ndarray, "3"], weight: float, sums: Float[np.ndarray, "n1 6"], start: int, stop: int) -> float:
    """Add a hypothesis, of which the returns [start, stop) are the line's, to what all returns lack; return its weight.

    That is its covariance less that of all, and the square of how far its estimate is off theirs.
    """
    s, all_of_them = sums[stop] - sums[start], sums[-1]
    det = s[0] * s[2] - s[1] * s[1]
    whole = all_of_them[0] * all_of_them[2] - all_of_them[1] * all_of_them[1]
    da, db = (s[2] * s[3] - s[1] * s[4]) / det, (s[0] * s[4] - s[1] * s[3]) / det
    mean[0] += weight * (s[2] / det - all_of_them[2] / whole + da * da)
    mean[1] += weight * (all_of_them[1] / whole - s[1] / det + da * db)
    mean[2] += weight * (s[0] / det - all_of_them[0] / whole + db * db)
    return weight
