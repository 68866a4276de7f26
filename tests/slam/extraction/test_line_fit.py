"""The algebra of lines in inverse range, and of the choice among pieces, against slow truths."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from slam.extraction.line_fit import Beams, Fit, fit_runs, polar, prefix_sums, refit
from slam.extraction.splitting import _least

SIGMA = 0.01
seeds = st.integers(0, 2**32)


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_prefix_sums_fit_every_run_as_weighted_least_squares_does(seed):
    rng = np.random.default_rng(seed)
    theta = np.deg2rad(np.arange(-180.0, 180.0, 2.0))
    rho = rng.uniform(0.3, 4.0, len(theta))
    start = rng.integers(0, len(rho) - 12, 5)
    stop = start + rng.integers(4, 12, 5)
    fit, values = fit_runs(prefix_sums(Beams(np.cos(theta), np.sin(theta), rho), np.full(len(rho), SIGMA)), start, stop)
    for i in range(5):
        run = slice(start[i], stop[i])
        rows = np.column_stack([np.cos(theta[run]), np.sin(theta[run])]) * (rho[run, None] ** 2 / SIGMA)
        target = rho[run] / SIGMA
        solution, *_ = np.linalg.lstsq(rows, target)
        np.testing.assert_allclose([fit.a[i], fit.b[i]], solution, rtol=1e-5, atol=1e-6)
        assert values[i] == pytest.approx(np.sum((rows @ solution - target) ** 2), rel=1e-5, abs=1e-5)


def test_refitting_converges_to_the_maximum_likelihood_line():
    rng = np.random.default_rng(0)
    theta = np.deg2rad(np.arange(-20.0, 50.0, 2.0))
    rho = 1.4 / np.cos(theta - 0.3) + SIGMA * rng.standard_normal(len(theta))
    beams, zeros = Beams(np.cos(theta), np.sin(theta), rho), np.zeros(len(theta), int)
    fit = Fit(*(np.array([x]) for x in (0.7, 0.2, 1.0, 0.0, 1.0)))
    for _ in range(6):
        fit = refit(fit, beams, zeros, np.array([0]), np.full(len(theta), SIGMA**-2))
    best = least_squares(lambda x: (x[1] / np.cos(theta - x[0]) - rho) / SIGMA, [0.3, 1.4], xtol=1e-14, ftol=1e-14)
    line, cov = polar(fit)
    np.testing.assert_allclose(line[0], best.x, atol=1e-6)
    np.testing.assert_allclose(cov[0], np.linalg.inv(best.jac.T @ best.jac), rtol=1e-4)


@given(seed=seeds, cuts=st.integers(2, 7))
@settings(max_examples=50, deadline=None)
def test_the_dynamic_program_finds_the_cheapest_of_all_divisions(seed, cuts):
    rng = np.random.default_rng(seed)
    at = np.concatenate([[0], np.cumsum(rng.integers(1, 4, cuts))])
    cost = {(i, j): float(rng.uniform(0.0, 30.0)) for j in range(1, cuts + 1) for i in range(j)}
    pieces = _least(list(cost.values()), [0] * cuts, at, 7.0)
    position = {int(x): i for i, x in enumerate(at)}
    chosen = [(position[int(i)], position[int(j)]) for i, j in zip(*pieces, strict=True)]

    def price(segments):
        covered = sum(int(at[j] - at[i]) for i, j in segments)
        return sum(cost[s] for s in segments) + 7.0 * (int(at[-1]) - covered)

    inner = range(1, cuts)
    divisions = (
        [pair for pair, used in zip(itertools.pairwise((0, *marks, cuts)), use, strict=True) if used]
        for size in range(cuts)
        for marks in itertools.combinations(inner, size)
        for use in itertools.product((False, True), repeat=size + 1)
    )
    assert price(chosen) == pytest.approx(min(map(price, divisions)))
