"""The interval of a mean NEES, whose errors last from pose to pose."""

import warnings

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter
from scipy.stats import chi2

from chainslam.experiments.library.audit.draws import (
    autocorrelation,
    effective_dof,
    interval,
    joint_dof,
    pooled_dof,
    score,
)
from chainslam.slam.evaluation.consistency import whitened


def lasting(n, phi, d=3, seed=0):
    """Return n errors of unit variance, of which each is correlated by phi with the one before."""
    w = np.random.default_rng(seed).standard_normal((n, d))
    w[1:] *= np.sqrt(1.0 - phi**2)
    return lfilter([1.0], [1.0, -phi], w, axis=0)


@pytest.mark.parametrize(("n", "rel"), [(240, 1e-9), (1700, 0.02)])
def test_errors_of_known_covariance_count_as_a_dense_computation_says(n, rel):
    """Of many errors only some are compared with all others, which changes little."""
    rng = np.random.default_rng(4)
    root = rng.standard_normal((2, 2))
    P = toeplitz(0.9 ** np.arange(n))
    covs = rng.uniform(1.0, 3.0, n)[:, None, None] * (root @ root.T)
    L = np.linalg.cholesky(covs)

    def cross(some):
        return np.einsum("iab,ij,jcb->iajc", L, P[:, some], L[some])

    found = joint_dof(np.linalg.inv(L), cross)
    assert found == pytest.approx((2 * n) ** 2 / (2 * np.sum(P**2)), rel=rel)


def test_the_nees_is_that_of_filterpy_and_of_a_dense_computation():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a library that is held against ours, not of ours
        from filterpy.stats import NEES
    rng = np.random.default_rng(1)
    roots, left = rng.standard_normal((50, 3, 3)), rng.standard_normal((50, 3))
    covs = roots @ roots.swapaxes(1, 2)
    found = score(whitened(left, covs))
    dense = [e @ np.linalg.inv(P) @ e for e, P in zip(left, covs, strict=True)]
    assert np.sum(whitened(left, covs) ** 2, axis=1) == pytest.approx(dense, rel=1e-9)
    assert 3.0 * found.anees == pytest.approx(
        np.mean(NEES(left[..., None], np.zeros_like(left)[..., None], covs)), rel=1e-9
    )
    assert found.covered[2] == np.mean(np.array(dense) <= chi2.ppf(0.95, 3))
    assert found.median == pytest.approx(np.median(dense) / chi2.median(3))


def test_the_autocorrelation_is_that_of_its_sum():
    w = lasting(40, 0.5)[:, 0]
    slow = [np.sum(w[k:] * w[: 40 - k]) / np.sqrt(np.sum(w[k:] ** 2) * np.sum(w[: 40 - k] ** 2)) for k in range(40)]
    assert autocorrelation(w) == pytest.approx(slow, abs=1e-12)


def test_an_error_that_lasts_is_one_draw_and_white_noise_as_many_as_it_has():
    assert effective_dof(np.tile([1.0, -2.0, 0.5], (500, 1))) == pytest.approx(3.0)
    assert effective_dof(lasting(2000, 0.0)) == pytest.approx(6000.0, rel=0.03)
    # The NEES of errors of correlation phi is correlated by phi^2.
    assert effective_dof(lasting(20000, 0.9)) == pytest.approx(60000.0 * (1 - 0.81) / (1 + 0.81), rel=0.15)


def test_the_interval_is_that_of_a_variance():
    low, high = interval(2.0, 12.0)
    assert (low, high) == pytest.approx((24.0 / chi2.ppf(0.975, 12), 24.0 / chi2.ppf(0.025, 12)))


def test_runs_together_have_the_degrees_of_freedom_of_all():
    one = score(lasting(300, 0.0))
    assert pooled_dof([one.dof] * 4) == pytest.approx(4.0 * one.dof)


@pytest.mark.parametrize("phi", [0.0, 0.9, 0.98, 1.0 - 1e-12], ids=["white", "short", "long", "for ever"])
def test_the_level_is_five_per_cent_however_long_errors_last(phi):
    found = [score(lasting(200, phi, seed=k)) for k in range(400)]
    assert 0.02 <= np.mean([each.low > 1.0 or each.high < 1.0 for each in found]) <= 0.09


def test_the_degrees_of_freedom_are_the_sum_in_their_definition():
    w = lasting(40, 0.9, d=1, seed=3)
    rho, total = autocorrelation(w[:, 0]), 1.0
    for k in range(1, 40):
        if rho[k] <= 0.0:
            break
        total += 2.0 * (1.0 - k / 40) * rho[k] ** 2
    found = score(w)
    assert found.dof == found.draws == pytest.approx(40.0 / total)
    assert score(lasting(40, 0.9)).draws == pytest.approx(effective_dof(lasting(40, 0.9)) / 3.0)


def test_the_regions_are_those_of_50_90_95_and_99_per_cent():
    nees = np.array([[chi2.ppf(p, 1)] for p in np.linspace(0.0025, 0.9975, 200)])
    assert score(np.sqrt(nees)).covered == pytest.approx((0.5, 0.9, 0.95, 0.99))


def test_less_than_a_degree_of_freedom_may_bound_nothing():
    assert interval(1.0, 1e-3)[1] == np.inf
