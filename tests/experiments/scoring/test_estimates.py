"""The numbers of an estimate, against arithmetic by hand and a bootstrap of plain loops."""

from itertools import product

import numpy as np
import pytest

from experiments.scoring.statistics import FEW_BUILDINGS, estimate, paired, share_better


def test_the_mean_the_runs_and_the_effect_size_are_the_plain_ones():
    found = estimate({("a", 1): 1.0, ("a", 2): 3.0, ("b", 1): 8.0})
    assert (found.mean, found.runs) == (4.0, 3)
    assert found.effect_size == pytest.approx(4.0 / 13.0**0.5)
    two = estimate({("a", 1): 1.0, ("a", 2): 3.0})
    assert two.effect_size == pytest.approx(2.0 / 2.0**0.5)


def test_one_run_is_its_own_interval_and_has_no_effect_size():
    found = estimate({("a", 1): 7.0})
    assert (found.mean, found.low, found.high, found.runs, found.effect_size) == (7.0, 7.0, 7.0, 1, None)
    assert estimate({("a", 1): 2.0, ("a", 2): 2.0}).effect_size is None
    assert estimate({}) is None


def test_the_same_values_give_the_same_interval_and_another_seed_another():
    values = {("a", k): float(x) for k, x in enumerate(np.random.default_rng(1).normal(size=30))}
    assert estimate(values) == estimate(values) == estimate(values, 0)
    assert estimate(values).low != estimate(values, 1).low
    assert estimate(dict(reversed(values.items()))) == estimate(values)


@pytest.mark.parametrize(("buildings", "told"), [(FEW_BUILDINGS - 1, False), (FEW_BUILDINGS, True)])
def test_an_interval_by_building_takes_five_of_them(buildings, told):
    found = estimate({(f"b{k}", seed): k + 0.1 * seed for k in range(buildings) for seed in range(3)})
    assert (found.low_buildings is not None) == (found.high_buildings is not None) == told
    if told:
        assert found.low_buildings < found.low < found.mean < found.high < found.high_buildings


def resampled(groups, draws, rng, by_building):
    """Means of resamples: runs drawn one at a time, each residual widened as a spread over n - 1 asks."""
    means = []
    for _ in range(draws):
        drawn = [groups[rng.integers(len(groups))] for _ in groups] if by_building else groups
        every = []
        for group in drawn:
            middle, widen = np.mean(group), np.sqrt(len(group) / max(len(group) - 1, 1))
            every += [middle + widen * (group[rng.integers(len(group))] - middle) for _ in group]
        means.append(np.mean(every))
    values = np.concatenate(groups)
    return np.quantile(np.clip(means, values.min(), values.max()), [0.025, 0.975])


GROUPS = [[0.0, 0.0, 0.0, 9.0], [1.0, 2.0, 30.0], [5.0, 5.5, 6.0, 6.5, 20.0], [3.0, 3.0, 12.0], [8.0, 9.0, 40.0, 41.0]]


SKEWED = [[0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 0.0, 1.0, 2.0, 40.0]]


@pytest.mark.parametrize(("groups", "by_building"), [(GROUPS, False), (GROUPS, True), (SKEWED, False)])
def test_an_interval_is_that_of_runs_drawn_one_at_a_time(groups, by_building):
    values = {(f"b{k}", seed): x for k, group in enumerate(groups) for seed, x in enumerate(group)}
    found = estimate(values)
    low, high = resampled(groups, 4000, np.random.default_rng(7), by_building)
    ours = (found.low_buildings, found.high_buildings) if by_building else (found.low, found.high)
    width = high - low
    # Ends of two bootstraps of 4,000 draws differ by about 2 % of their width; a skewed group shows a mirrored one.
    assert ours == pytest.approx((low, high), abs=0.06 * width)


def test_of_two_runs_in_a_building_every_resample_is_known():
    """Each building's mean is its own, or off by sqrt(2) half differences: 1, 2, 1 of 4 draws."""
    halves = (1.0, 2.0, 4.0)
    values = {(f"b{k}", sign): 10.0 + sign * half for k, half in enumerate(halves) for sign in (-1, 1)}
    shares = ((-1.0, 0.25), (0.0, 0.5), (1.0, 0.25))
    means = {}
    for draw in product(shares, repeat=3):
        off = sum(sign * half * 2.0**0.5 for (sign, _), half in zip(draw, halves, strict=True)) / 3.0
        means[off] = means.get(off, 0.0) + float(np.prod([share for _, share in draw]))
    reached = 0.0
    for off in sorted(means, reverse=True):
        reached += means[off]
        if reached > 0.025:
            break
    found = estimate(values)
    assert (found.low, found.high) == pytest.approx((10.0 - off, 10.0 + off))


def test_pairs_are_first_less_second_over_the_runs_of_both():
    assert paired({("a", 1): 5.0, ("a", 2): 1.0}, {("a", 1): 3.0, ("b", 1): 9.0}) == {("a", 1): 2.0}


def test_the_smaller_value_is_the_better_one_and_a_missing_one_loses():
    first = {("a", 1): 1.0, ("a", 2): 2.0, ("a", 3): 3.0, ("a", 4): 4.0}
    second = {("a", 1): 2.0, ("a", 2): 2.0, ("a", 3): 1.0, ("a", 5): 5.0}
    each = {1: 1.0, 2: 0.5, 3: 0.0, 4: 1.0, 5: 0.0, 6: 0.5}
    for seed, share in each.items():
        assert share_better(first, second, {("a", seed)}) == share
    assert share_better(first, second, {("a", seed) for seed in each}) == pytest.approx(3.0 / 6.0)
