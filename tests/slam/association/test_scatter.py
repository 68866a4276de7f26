"""The scatter of sightings about walls: what is estimated from errors of known size and correlation."""

from dataclasses import fields, replace

import numpy as np
import pytest

from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.association.second_looks.landmarks import Sightings
from chainslam.slam.association.second_looks.scatter import LEAST, as_scattered, scatter
from chainslam.slam.association.second_looks.solve import Unknowns

CONFIG = SecondLooksConfig()
WALLS, EACH = 40, 100
OWNER = np.repeat(np.arange(WALLS), EACH)


def correlated(rng, correlation):
    """Errors of unit variance, those of each wall a first-order autoregressive process."""
    errors = rng.standard_normal((WALLS, EACH))
    for k in range(1, EACH):
        errors[:, k] = correlation * errors[:, k - 1] + np.sqrt(1.0 - correlation**2) * errors[:, k]
    return errors.ravel()


def told(errors, stated):
    return scatter(errors, stated, OWNER, CONFIG.doubt)


@pytest.mark.parametrize("seed", range(5))
def test_white_errors_of_the_stated_size_change_nothing(seed):
    rng = np.random.default_rng([51, seed])
    stated = rng.uniform(0.5, 2.0, len(OWNER))
    found = told(stated * rng.standard_normal(len(OWNER)), stated)
    assert found.floor < 0.3
    assert 1.0 <= found.shared < 1.15


@pytest.mark.parametrize("floor", [0.5, 1.0, 5.0])
def test_the_floor_is_what_the_errors_have_beyond_what_is_stated(floor):
    rng = np.random.default_rng(52)
    stated = rng.uniform(0.5, 2.0, len(OWNER))
    found = told(np.hypot(stated, floor) * rng.standard_normal(len(OWNER)), stated)
    assert found.floor == pytest.approx(floor, rel=0.2)


def test_gross_errors_move_the_floor_little_however_large_they_are():
    rng = np.random.default_rng(53)
    errors, stated = np.sqrt(2.0) * rng.standard_normal(len(OWNER)), np.ones(len(OWNER))
    found = []
    for size in (0.0, 1e2, 1e6):
        errors[::50] = size
        found.append(told(errors, stated).floor)
    assert found[1] == pytest.approx(found[2], rel=1e-3)
    assert found[2] < 1.25 * found[0]


@pytest.mark.parametrize("correlation", [0.3, 0.5, 0.8])
def test_errors_of_known_correlation_are_counted_so_often(correlation):
    # The mean of many such errors has (1 + r) / (1 - r) times the variance of independent ones.
    found = [
        told(correlated(np.random.default_rng([54, seed]), correlation), np.ones(len(OWNER))) for seed in range(10)
    ]
    wanted = (1.0 + correlation) / (1.0 - correlation)
    assert np.mean([each.shared for each in found]) == pytest.approx(wanted, rel=0.15)


def test_what_errors_of_different_walls_have_in_common_does_not_count():
    """Walls of two sightings each: the second of one and the first of the next are equal, those of one wall are not."""
    rng = np.random.default_rng(63)
    errors = np.concatenate([rng.standard_normal(1), np.repeat(rng.standard_normal(1999), 2), rng.standard_normal(1)])
    assert scatter(errors, np.ones(4000), np.repeat(np.arange(2000), 2), CONFIG.doubt).shared < 1.15


def test_from_fewer_than_thirty_pairs_no_correlation_is_estimated():
    for walls, known in ((29, False), (30, True)):
        owner = np.concatenate([np.repeat(np.arange(walls), 2), 1000 + np.arange(200)])
        errors = np.concatenate([np.ones(2 * walls), np.tile([1.0, -1.0], 100)])
        assert (scatter(errors, np.ones(len(errors)), owner, CONFIG.doubt).shared > 1.1) == known


def test_correlation_across_walls_does_not_count():
    rng = np.random.default_rng(55)
    errors = correlated(rng, 0.9)
    mixed = rng.permutation(len(errors))
    assert scatter(errors[mixed], np.ones(len(errors)), OWNER, CONFIG.doubt).shared < 1.15


def test_the_unit_of_errors_says_nothing():
    rng = np.random.default_rng(56)
    errors, stated = 2.0 * correlated(rng, 0.5), np.ones(len(OWNER))
    metres, millimetres = told(errors, stated), told(1e3 * errors, 1e3 * stated)
    assert millimetres.floor == pytest.approx(1e3 * metres.floor, rel=1e-6)
    assert millimetres.shared == pytest.approx(metres.shared, rel=1e-6)


def seen(rng, count, sigma_rad, sigma_m, correlation=0.0):
    """Sightings of one wall along x at y = 1 from the origin, and the solution: the wall as it is."""
    errors = rng.standard_normal((2, count))
    for k in range(1, count):
        errors[:, k] = correlation * errors[:, k - 1] + np.sqrt(1.0 - correlation**2) * errors[:, k]
    y = 1.0 + sigma_m * errors[0]
    ends = np.stack([np.column_stack([np.full(count, x), y]) for x in (1.0, -1.0)], axis=1)
    alpha = np.pi / 2 + sigma_rad * errors[1]
    sightings = Sightings(np.arange(count), alpha, ends, np.full(count, 1e-3), np.full(count, 2e-3))
    at = Unknowns(np.zeros((count, 3)), np.array([[np.pi / 2, 0.0]]), np.array([[0.0, 1.0]]))
    return at, sightings, np.zeros(count, dtype=np.int64)


def test_variances_after_it_are_those_of_the_errors_times_how_often_they_are_counted():
    at, sightings, owner = seen(np.random.default_rng(57), 4000, 0.01, 0.005)
    scattered, config = as_scattered(at, sightings, owner, CONFIG)
    assert np.hypot(scattered.sigma_rad, config.floor_rad) == pytest.approx(0.01, rel=0.1)
    assert np.hypot(scattered.sigma_m, config.floor_m) == pytest.approx(0.005, rel=0.1)
    at, sightings, owner = seen(np.random.default_rng(58), 4000, 0.01, 0.005, 0.6)
    scattered, config = as_scattered(at, sightings, owner, CONFIG)
    assert np.hypot(scattered.sigma_m, config.floor_m) == pytest.approx(0.005 * 2.0, rel=0.2)


def test_the_variance_is_the_same_in_whatever_order_the_sightings_stand():
    """Three walls seen in turn: one scan after the other, or all of a wall side by side."""
    at, sightings, _ = seen(np.random.default_rng(62), 3000, 0.01, 0.005, 0.8)
    owner = np.repeat(np.arange(3), 1000)
    three = replace(
        at,
        **{
            field.name: np.repeat(getattr(at, field.name), 3, axis=0)
            for field in fields(at)
            if len(getattr(at, field.name)) == 1
        },
    )
    order = np.argsort(np.tile(np.arange(1000), 3), kind="stable")
    shuffled = Sightings(*(getattr(sightings, field.name)[order] for field in fields(sightings)))
    one, again = as_scattered(three, sightings, owner, CONFIG), as_scattered(three, shuffled, owner[order], CONFIG)
    assert again[1].floor_m == pytest.approx(one[1].floor_m, rel=1e-9)
    np.testing.assert_allclose(again[0].sigma_m, one[0].sigma_m[order], rtol=1e-9)
    assert one[1].floor_m > 0.005 * 2.0


def test_directions_too_are_counted_as_often_as_they_err_together():
    at, sightings, owner = seen(np.random.default_rng(64), 4000, 0.01, 0.005, 0.6)
    scattered, config = as_scattered(at, sightings, owner, CONFIG)
    assert np.hypot(scattered.sigma_rad, config.floor_rad) == pytest.approx(0.01 * 2.0, rel=0.2)


def test_what_was_assumed_before_decides_nothing():
    at, sightings, owner = seen(np.random.default_rng(59), 1000, 0.01, 0.005, 0.3)
    other = replace(CONFIG, floor_rad=0.1, floor_m=0.3)
    for one, again in zip(
        as_scattered(at, sightings, owner, CONFIG), as_scattered(at, sightings, owner, other), strict=True
    ):
        for name in ("sigma_rad", "sigma_m") if isinstance(one, Sightings) else ("floor_rad", "floor_m"):
            np.testing.assert_allclose(getattr(one, name), getattr(again, name), rtol=1e-6)


@pytest.mark.parametrize("count", [0, 1, LEAST - 1])
def test_of_few_sightings_nothing_is_known(count):
    at, sightings, owner = seen(np.random.default_rng(60), count, 0.01, 0.005)
    assert as_scattered(at, sightings, owner, CONFIG) == (sightings, CONFIG)


def test_errors_that_are_all_zero_need_no_floor():
    at, sightings, owner = seen(np.random.default_rng(61), 50, 0.0, 0.0)
    scattered, config = as_scattered(at, sightings, owner, CONFIG)
    assert (config.floor_rad, config.floor_m) == (0.0, 0.0)
    assert np.all(np.isfinite(scattered.sigma_m))
