"""What a fit lacks where outer beams may be another face's: a mean over which of them are, by Bayes' rule.

Hypotheses are that none, the last or the last two returns at either end are another face's. Those lie anywhere within
`outlier_sigmas` of what the others predict, else they were left out: for each, the odds of the hypothesis change by
sqrt(2 pi) / (2 outlier_sigmas), and by exp(half of the chi-square that the others save). The mean of the covariances,
with the spread of the estimates about that of all returns (Hoeting et al., Bayesian model averaging, 1999).
"""

import numpy as np
from jaxtyping import Float

from ...geometry.compiled import compiled
from .line_kernels import Line, met_at, variance_met
from .returns_kernels import Returns, Rules


@compiled
def odds_of_end(line: Line, last: int, step: int, returns: Returns, rules: Rules) -> float:
    """Return the odds that the outer return `last` of a line is another face's, by what the next beam past it met.

    A beam past the line looks on behind it, where other faces may stand. One that met the line was left out to be safe,
    or something nearer hides the rest.
    """
    m = len(returns.beam)
    at, before = (last + step) % m, last % m
    steps = returns.beam[at] - returns.beam[before] - step
    if steps and not (returns.period and steps % returns.period == 0):
        return rules.other_odds
    inverse = line.a * returns.cos[at] + line.b * returns.sin[at]
    if inverse <= 0.0:
        return rules.other_odds**2
    past = returns.ranges_m[at] - met_at(line, returns.cos[at], returns.sin[at])
    variance = returns.sigmas_m[at] ** 2 + variance_met(line, returns.cos[at], returns.sin[at])
    return rules.other_odds if past > rules.outlier_sigmas * np.sqrt(variance) else rules.other_odds**2


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
    used = np.flatnonzero(keep > 0.0)
    n = len(used)
    # Of each return, scaled by its noise: the derivative of its range by (a, b), and its residual.
    g, e = np.empty((n, 2)), np.empty(n)
    for k in range(n):
        i = used[k]
        p, scale = met_at(line, cos[i], sin[i]), np.sqrt(keep[i])
        g[k, 0], g[k, 1] = -p * p * cos[i] * scale, -p * p * sin[i] * scale
        e[k] = (ranges_m[i] - p) * scale
    chi2 = np.sum(e * e)
    factor = np.sqrt(2.0 * np.pi) / (2.0 * outlier_sigmas)
    total, mean = 0.0, np.zeros(3)
    for i in range(3):
        for j in range(3):
            if n - i - j < 2:
                continue
            cc, cs, ss, xc, xs, qq = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(i, n - j):
                cc += g[k, 0] * g[k, 0]
                cs += g[k, 0] * g[k, 1]
                ss += g[k, 1] * g[k, 1]
                xc += g[k, 0] * e[k]
                xs += g[k, 1] * e[k]
                qq += e[k] * e[k]
            det = cc * ss - cs * cs
            da, db = (ss * xc - cs * xs) / det, (cc * xs - cs * xc) / det
            saved = chi2 - (qq - da * xc - db * xs)
            weight = odds[0] ** i * odds[1] ** j * factor ** (i + j) * np.exp(0.5 * saved)
            total += weight
            mean[0] += weight * (ss / det + da * da)
            mean[1] += weight * (da * db - cs / det)
            mean[2] += weight * (cc / det + db * db)
    det = line.cc * line.ss - line.cs * line.cs
    return mean / total - np.array([line.ss, -line.cs, line.cc]) / det
