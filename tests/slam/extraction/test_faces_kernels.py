"""The mean over which returns are another face's: against the same worked out plainly, and against drawn faces."""

import numpy as np
import pytest

from slam.extraction.config import ExtractionConfig
from slam.extraction.extract import beams_of_scan, extract, rules_of
from slam.extraction.kernels.faces_kernels import odds_of_other_faces, spread_over_faces
from slam.extraction.kernels.line_kernels import Line, fit_run, prefix_sums, refit
from slam.extraction.kernels.returns_kernels import returns_of
from slam.robot import Scan

SIGMA_M = 0.01
SIGMAS = 3.0
CHANCE = np.sqrt(2.0 * np.pi) / (2.0 * SIGMAS)


def fitted(ranges_m, bearings):
    """Return the line through returns, and what kernels take of them."""
    cos, sin, sigmas = np.cos(bearings), np.sin(bearings), np.full(len(bearings), SIGMA_M)
    line, _ = fit_run(prefix_sums(cos, sin, ranges_m, sigmas), 0, len(bearings))
    keep = 1.0 / sigmas**2
    return refit(refit(line, cos, sin, ranges_m, keep), cos, sin, ranges_m, keep), cos, sin, ranges_m, keep


def linear(line, cos, sin, ranges_m):
    """Return of each return, in sigmas, the derivative of its range by (a, b) and its residual."""
    p = 1.0 / (line.a * cos + line.b * sin)
    return -(p**2)[:, None] * np.column_stack([cos, sin]) / SIGMA_M, (ranges_m - p) / SIGMA_M


def evidence(g, e):
    """Return how likely returns on one line are, a flat prior on the line, and the line and its covariance."""
    cov = np.linalg.inv(g.T @ g)
    step = cov @ g.T @ e
    chi2 = np.sum((e - g @ step) ** 2)
    return np.sqrt(np.linalg.det(cov)) * 2.0 * np.pi * (2.0 * np.pi) ** (-0.5 * len(e)) * np.exp(-0.5 * chi2), step, cov


def expected(g, e, odds):
    """Return what the covariance lacks, hypothesis by hypothesis: densities of ranges in place of ratios."""
    n = len(e)
    whole, _, cov_of_all = evidence(g, e)

    def width(row, rows):
        cov = np.linalg.inv(g[rows].T @ g[rows])
        return 2.0 * SIGMAS * np.sqrt(1.0 + g[row] @ cov @ g[row])

    found = [(1.0, np.zeros(2), cov_of_all)]
    for i in range(3):
        for j in range(3):
            if i + j and n - i - j >= 2:
                rows = list(range(i, n - j))
                like, step, cov = evidence(g[rows], e[rows])
                for row in [*range(i - 1, -1, -1), *range(n - j, n)]:
                    like /= width(row, rows)
                    rows.append(row)
                found.append((odds[0] ** i * odds[1] ** j * like / whole, step, cov))
    for at in range(3, n - 2):
        sides = (list(range(at)), list(range(at, n)))
        for of, (others, rows) in enumerate((sides, sides[::-1])):
            if len(rows) < len(others):
                continue
            like, step, cov = evidence(g[rows], e[rows])
            other, _, _ = evidence(g[others], e[others])
            near = others[-2:][::-1] if of == 0 else others[:2]
            # The flat prior on their line becomes one on the ranges of the two next to the bend.
            other *= abs(np.linalg.det(g[near])) / width(near[0], rows) / width(near[1], [*rows, near[0]])
            found.append((odds[of] ** 2 * like * other / whole, step, cov))
    total = sum(weight for weight, _, _ in found)
    return sum(weight / total * (cov + np.outer(step, step)) for weight, step, cov in found) - cov_of_all


@pytest.mark.parametrize("count", [3, 4, 5, 6, 9, 14])
@pytest.mark.parametrize("off_m", [0.0, 0.03])
def test_it_is_the_mean_over_all_hypotheses(count, off_m):
    rng = np.random.default_rng(count)
    bearings = 0.3 + 0.035 * np.arange(count)
    ranges = 1.5 / np.cos(bearings) + SIGMA_M * rng.standard_normal(count)
    ranges[: count // 3] += off_m
    line, *rest = fitted(ranges, bearings)
    odds = np.array([0.4, 0.1])
    C = expected(*linear(line, *rest[:3]), odds)
    np.testing.assert_allclose(spread_over_faces(line, *rest, odds, SIGMAS), [C[0, 0], C[0, 1], C[1, 1]], rtol=1e-6)


def test_where_no_return_can_be_another_faces_nothing_is_lacking():
    line, *rest = fitted(1.5 / np.cos(0.05 * np.arange(8)), 0.05 * np.arange(8))
    assert not spread_over_faces(line, *rest, np.zeros(2), SIGMAS).any()


def scan_of(beyond_m):
    """Return a scan of seven beams on a wall 2 m off, and what the beam beside the last one met."""
    bearings = np.deg2rad(2.0) * np.arange(180)
    ranges = np.full(180, np.inf)
    ranges[:7] = 2.0 / np.cos(bearings[:7])
    ranges[7] = beyond_m / np.cos(bearings[7])
    return Scan(bearings, ranges, SIGMA_M, 4.0, 0.0)


@pytest.mark.parametrize(("beyond_m", "is_free"), [(np.inf, True), (2.2, True), (2.0, False), (1.5, False)])
def test_a_last_return_is_another_faces_by_what_the_next_beam_met(beyond_m, is_free):
    """Nothing, something behind, the same wall, something in front."""
    rules = rules_of(ExtractionConfig())
    bearings, ranges, sigmas, share, farthest, is_full_turn = beams_of_scan(scan_of(beyond_m))
    returns = returns_of(bearings, ranges, sigmas, share, farthest, is_full_turn, rules)
    cos, sin, on = np.cos(bearings[:7]), np.sin(bearings[:7]), ranges[:7]
    line, _ = fit_run(prefix_sums(cos, sin, on, sigmas[:7]), 0, 7)
    first = int(np.flatnonzero(returns.beam == 0)[0])
    odds = odds_of_other_faces(Line(*line), first, first + 6, returns, rules)
    length = 2.0 * np.tan(bearings[6])
    one = 0.2 / (0.2 + length)
    np.testing.assert_allclose(odds, [one, one if is_free else one**2], rtol=1e-6)


def test_a_segment_knows_its_direction_less_where_its_residuals_tell_of_a_bend():
    """Four beams before a step of 4 cm and four behind it."""
    bearings = np.deg2rad(1.0) * np.arange(-4, 4)
    straight, stepped = (1.0 / np.cos(bearings) + step * (bearings >= 0.0) for step in (0.0, 0.04))
    scans = [Scan(bearings, ranges, SIGMA_M, 4.0, 0.0) for ranges in (straight, stepped)]
    (one,), (two,) = ((segments.faces_cov[0, 0, 0],) for segments in map(extract, scans))
    assert two > 2.0 * one
