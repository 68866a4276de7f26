"""The algebra of lines in inverse range against slow truths."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from chainslam.slam.extraction.kernels.line_kernels import (
    Line,
    crossing,
    fit_run,
    line_of,
    met_at,
    polar,
    prefix_sums,
    put,
    refit,
    variance_met,
)

SIGMA = 0.01
seeds = st.integers(0, 2**32)


def any_line(rng):
    half = rng.normal(size=(2, 2))
    information = half @ half.T + 0.1 * np.eye(2)
    return Line(*rng.normal(size=2).tolist(), information[0, 0], information[0, 1], information[1, 1])


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_prefix_sums_fit_every_run_as_weighted_least_squares_does(seed):
    rng = np.random.default_rng(seed)
    theta = np.deg2rad(np.arange(-180.0, 180.0, 2.0))
    rho, sigmas = rng.uniform(0.3, 4.0, len(theta)), rng.uniform(0.005, 0.02, len(theta))
    sums = prefix_sums(np.cos(theta), np.sin(theta), rho, sigmas)
    for start, size in zip(rng.integers(0, len(rho) - 12, 5).tolist(), rng.integers(4, 12, 5).tolist(), strict=True):
        run = slice(start, start + size)
        line, chi2 = fit_run(sums, start, start + size)
        rows = np.column_stack([np.cos(theta[run]), np.sin(theta[run])]) * (rho[run] ** 2 / sigmas[run])[:, None]
        target = rho[run] / sigmas[run]
        solution, *_ = np.linalg.lstsq(rows, target)
        np.testing.assert_allclose(line[:2], solution, rtol=1e-5, atol=1e-6)
        information = np.array([[line.cc, line.cs], [line.cs, line.ss]])
        np.testing.assert_allclose(information, rows.T @ rows, rtol=1e-6, atol=1e-6)
        assert chi2 == pytest.approx(np.sum((rows @ solution - target) ** 2), rel=1e-5, abs=1e-5)


def test_refitting_converges_to_the_maximum_likelihood_line_of_the_beams_that_count():
    rng = np.random.default_rng(0)
    theta = np.deg2rad(np.arange(-20.0, 50.0, 2.0))
    rho = 1.4 / np.cos(theta - 0.3) + SIGMA * rng.standard_normal(len(theta))
    keep = np.where(np.arange(len(theta)) == 7, 0.0, SIGMA**-2)
    rho[7] += 1.0
    line = Line(0.7, 0.2, 1.0, 0.0, 1.0)
    for _ in range(6):
        line = refit(line, np.cos(theta), np.sin(theta), rho, keep)
    best = least_squares(
        lambda x: (x[1] / np.cos(theta - x[0]) - rho) * np.sqrt(keep), [0.3, 1.4], xtol=1e-14, ftol=1e-14
    )
    alpha, r, alphas, both, rs = polar(line)
    np.testing.assert_allclose([alpha, r], best.x, atol=1e-6)
    np.testing.assert_allclose([[alphas, both], [both, rs]], np.linalg.inv(best.jac.T @ best.jac), rtol=1e-4)


@given(seed=seeds, bearing=st.floats(-3.0, 3.0))
@settings(max_examples=100, deadline=None)
def test_the_range_at_which_a_line_is_met_varies_as_its_slope_says(seed, bearing):
    line = any_line(np.random.default_rng(seed))
    c, s = np.cos(bearing), np.sin(bearing)
    if abs(line.a * c + line.b * s) < 0.2:
        return
    h = 1e-6
    slope = [
        (met_at(line._replace(a=line.a + da), c, s) - met_at(line._replace(a=line.a - da), c, s)) / (2 * h) if da else
        (met_at(line._replace(b=line.b + h), c, s) - met_at(line._replace(b=line.b - h), c, s)) / (2 * h)
        for da in (h, 0.0)
    ]  # fmt: skip
    cov = np.linalg.inv([[line.cc, line.cs], [line.cs, line.ss]])
    assert variance_met(line, c, s) == pytest.approx(slope @ cov @ slope, rel=1e-5)


@given(seed=seeds, bearing=st.floats(-3.0, 3.0))
@settings(max_examples=100, deadline=None)
def test_at_their_crossing_two_lines_are_met_at_one_range(seed, bearing):
    rng = np.random.default_rng(seed)
    one, other = any_line(rng), any_line(rng)
    past = crossing(one, other, np.cos(bearing), np.sin(bearing))
    assert abs(past) <= np.pi / 2
    c, s = np.cos(bearing + past), np.sin(bearing + past)
    assert one.a * c + one.b * s == pytest.approx(other.a * c + other.b * s, abs=1e-9)


def test_a_line_among_many_is_the_one_that_was_put_there():
    rows, line = np.zeros((3, 5)), Line(1.0, 2.0, 3.0, 4.0, 5.0)
    put(rows, 1, line)
    assert line_of(rows, 1) == line
    assert line_of(rows, 2) == Line(0.0, 0.0, 0.0, 0.0, 0.0)
