"""The numbers of an estimate, against arithmetic by hand, scipy, and a bootstrap of plain loops."""

import numpy as np
import pytest
from scipy import stats

from chainslam.experiments.scoring.statistics import LEAST, estimate, mean_interval, paired, share_better


def test_the_mean_the_runs_and_the_effect_size_are_the_plain_ones():
    found = estimate({("a", 1): 1.0, ("a", 2): 3.0, ("b", 1): 8.0})
    assert (found.mean, found.runs) == (4.0, 3)
    assert found.effect_size == pytest.approx(4.0 / 13.0**0.5)
    two = estimate({("a", 1): 1.0, ("a", 2): 3.0})
    assert two.effect_size == pytest.approx(2.0 / 2.0**0.5)


def test_few_runs_have_neither_interval_nor_test_and_one_no_effect_size():
    four = estimate({("a", seed): float(seed) for seed in range(LEAST - 1)})
    assert four.low is four.high is four.low_buildings is four.p is None
    assert LEAST == 5
    one = estimate({("a", 1): 7.0})
    assert (one.mean, one.low, one.runs, one.effect_size) == (7.0, None, 1, None)
    assert estimate({("a", 1): 2.0, ("a", 2): 2.0}).effect_size is None
    assert estimate({}) is None
    assert mean_interval(np.arange(4.0)) is None


def test_a_building_of_one_run_tells_nothing_of_other_runs_there():
    alone = {(f"b{k}", 1): float(k) for k in range(LEAST)}
    found = estimate(alone)
    assert found.low is None
    assert found.low_buildings is not None
    assert estimate(alone | {(f"b{k}", 2): k + 0.5 for k in range(LEAST)}).low is not None


def test_values_that_are_all_the_same_are_their_own_interval():
    found = estimate({("a", seed): 3.0 for seed in range(LEAST)})
    assert (found.mean, found.low, found.high, found.p) == (3.0, 3.0, 3.0, 0.0)
    assert estimate({("a", seed): 0.0 for seed in range(LEAST)}).p == 1.0


def test_the_same_values_give_the_same_interval_and_another_seed_another():
    values = {("a", k): float(x) for k, x in enumerate(np.random.default_rng(1).normal(size=30))}
    assert estimate(values) == estimate(values) == estimate(values, 0)
    assert estimate(values).low != estimate(values, 1).low
    assert estimate(dict(reversed(values.items()))) == estimate(values)


def test_by_building_it_is_students_interval_of_the_buildings_means():
    groups = np.random.default_rng(2).normal(size=(LEAST, 3)) + 5.0
    found = estimate({(f"b{k}", seed): x for k, group in enumerate(groups) for seed, x in enumerate(group)})
    expected = stats.t.interval(0.95, LEAST - 1, groups.mean(), stats.sem(groups.mean(axis=1)))
    assert (found.low_buildings, found.high_buildings) == pytest.approx(expected)
    assert found.p == pytest.approx(stats.ttest_1samp(groups.mean(axis=1), 0.0).pvalue)
    assert estimate({(f"b{k}", seed): float(k) for k in range(LEAST - 1) for seed in range(3)}).low_buildings is None


@pytest.mark.parametrize("seed", range(4))
def test_a_building_counts_by_its_runs(seed):
    """Against a jackknife of the buildings, of which some have many runs and some few."""
    rng = np.random.default_rng(seed)
    groups = [rng.normal() + 0.1 * rng.normal(size=n) for n in (2, 2, 3, 3, 4, 4, 5, 20, 40, 60)]
    found = estimate({(f"b{k}", run): x for k, group in enumerate(groups) for run, x in enumerate(group)})
    without = np.array([np.concatenate(groups[:k] + groups[k + 1 :]).mean() for k in range(10)])
    error = np.sqrt(9 / 10 * np.sum((without - without.mean()) ** 2))
    stated = (found.high_buildings - found.low_buildings) / 2 / stats.t.ppf(0.975, 9)
    assert 0.6 < stated / error < 1.1


def test_over_runs_it_is_welchs_test_of_the_buildings_sum():
    """Of two buildings of equally many runs the mean is half of the sum: Welch's test of one and minus the other."""
    one, other = np.random.default_rng(3).normal(size=(2, 8)) * [[1.0], [5.0]]
    found = estimate({(name, seed): x for name, group in (("a", one), ("b", other)) for seed, x in enumerate(group)})
    assert found.p == pytest.approx(stats.ttest_ind(one, -other, equal_var=False).pvalue)
    alone = estimate({("a", seed): x for seed, x in enumerate(one)})
    assert alone.p == pytest.approx(stats.ttest_1samp(one, 0.0).pvalue)


def resampled(groups, draws, rng):
    """The ends of a studentised bootstrap by plain loops: runs drawn one at a time within each building."""
    total = sum(map(len, groups))

    def mean_and_error(samples):
        parts = [np.var(sample, ddof=1) * len(sample) / total**2 for sample in samples]
        return np.concatenate(samples).mean(), np.sqrt(sum(parts))

    middle, error = mean_and_error(groups)
    found = []
    for _ in range(draws):
        mean, own = mean_and_error([[group[rng.integers(len(group))] for _ in group] for group in groups])
        found.append((mean - middle) / own if own > 0 else np.copysign(np.inf, mean - middle))
    low, high = np.quantile(found, [0.025, 0.975], method="inverted_cdf")
    return middle - high * error, middle - low * error


GROUPS = [[0.0, 0.5, 0.0, 9.0, 2.0, 4.0], [1.0, 2.0, 30.0, 4.0, 8.0], [5.0, 5.5, 6.0, 6.5, 20.0]]
SKEWED = [[0.0, 1.0, 2.0, 0.3, 1.1, 2.5, 0.2, 1.6, 2.1, 40.0]]


@pytest.mark.parametrize("groups", [GROUPS, SKEWED])
def test_an_interval_is_that_of_runs_drawn_one_at_a_time(groups):
    values = {(f"b{k}", seed): x for k, group in enumerate(groups) for seed, x in enumerate(group)}
    found = estimate(values)
    low, high = resampled(groups, 4000, np.random.default_rng(7))
    # A skewed group leans the interval to its long side; tails of two bootstraps of 4,000 draws differ by some percent.
    assert high - found.mean > found.mean - low
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.12 * (high - low))


def test_values_of_which_most_are_the_same_get_students_ends():
    """Most resamples have no spread, and so no t of their own."""
    found = estimate({("a", seed): float(seed == 0) for seed in range(6)})
    expected = stats.t.interval(0.95, 5, 1.0 / 6.0, stats.sem([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert found.low == pytest.approx(expected[0]) or found.high == pytest.approx(expected[1])
    assert np.isfinite([found.low, found.high]).all()


def test_pairs_are_first_less_second_over_the_runs_of_both():
    assert paired({("a", 1): 5.0, ("a", 2): 1.0}, {("a", 1): 3.0, ("b", 1): 9.0}) == {("a", 1): 2.0}


def test_the_smaller_value_is_the_better_one_and_a_missing_one_loses():
    first = {("a", 1): 1.0, ("a", 2): 2.0, ("a", 3): 3.0, ("a", 4): 4.0}
    second = {("a", 1): 2.0, ("a", 2): 2.0, ("a", 3): 1.0, ("a", 5): 5.0}
    each = {1: 1.0, 2: 0.5, 3: 0.0, 4: 1.0, 5: 0.0, 6: 0.5}
    for seed, share in each.items():
        assert share_better(first, second, {("a", seed)}) == share
    assert share_better(first, second, {("a", seed) for seed in each}) == pytest.approx(3.0 / 6.0)
