"""Verdicts on simulated drives of a true EKF, and of one that is told another noise of its scanner."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.consistency import CAUTIOUS, CONSISTENT, OVERCONFIDENT
from chainslam.experiments.library.audit.draws import interval, score
from chainslam.experiments.library.audit.geometry.plane import errors
from chainslam.experiments.library.audit.verdicts import TOO_FEW, compare, judge, pool
from chainslam.experiments.scoring.statistics import mean_interval
from chainslam.slam.evaluation.consistency import whitened

from .drives import drives
from .test_draws import lasting


def scores(told, runs=200, steps=300, seed=1):
    return [
        score(whitened(errors(d.estimated, d.true, "additive"), d.covs)) for d in drives(runs, steps, told, seed=seed)
    ]


def words(found):
    return [judge(each.anees, each.low, each.high, each.dof).words for each in found]


def rejected(found):
    return np.mean([each.low > 1.0 or each.high < 1.0 for each in found])


@pytest.mark.long
def test_of_200_true_runs_three_to_eight_per_cent_are_rejected_and_few_called_overconfident():
    for steps in (100, 300, 1000):
        found = scores(1.0, steps=steps, seed=steps)
        assert 0.03 <= rejected(found) <= 0.08
        assert words(found).count(OVERCONFIDENT) <= 6


@pytest.mark.long
def test_an_ekf_told_half_the_noise_is_overconfident_in_95_of_100_runs_of_300_poses_and_in_every_campaign_of_five():
    found = scores(0.5, seed=300)
    assert words(found).count(OVERCONFIDENT) >= 190
    assert words(scores(0.5, steps=1000, seed=1000)).count(OVERCONFIDENT) == 200
    short = scores(0.5, steps=100, seed=100)
    assert words(short).count(TOO_FEW) > 50  # 100 poses cannot tell ...
    campaigns = [pool(short[k : k + 5]).verdict.words for k in range(0, 200, 5)]
    assert campaigns.count(OVERCONFIDENT) >= 38  # ... but five such runs together can


@pytest.mark.long
def test_an_ekf_told_twice_the_noise_is_too_cautious_in_campaigns_of_ten():
    found = scores(2.0)
    assert [pool(found[k : k + 10]).verdict.words for k in range(0, 200, 10)].count(CAUTIOUS) >= 19


def test_few_runs_of_a_true_and_of_a_wrong_ekf_get_their_verdicts():
    assert pool(scores(1.0, runs=8)).verdict.words == CONSISTENT
    verdict = pool(scores(0.5, runs=8)).verdict
    assert verdict.words == OVERCONFIDENT
    assert verdict.factor == pytest.approx(np.sqrt(1.6), rel=0.1)
    assert pool(scores(4.0, runs=8)).verdict.words == CAUTIOUS


def test_a_single_error_that_lasts_tells_little():
    steady = score(np.tile([1.5, -1.0, 1.0], (500, 1)))
    assert words([steady]) == [TOO_FEW]
    assert words([score(np.tile([0.1, 0.1, 0.1], (500, 1)))]) == [TOO_FEW]
    assert words([score(np.tile([9.0, 0.0, 0.0], (500, 1)))]) == [OVERCONFIDENT]


def test_what_may_only_be_larger_is_overconfident_or_untold():
    assert judge(0.1, 0.05, 0.2, is_bound=True).words == TOO_FEW
    assert judge(1.0, 0.99, 1.01, is_bound=True).words == TOO_FEW
    assert judge(4.0, 3.0, 5.0, is_bound=True).words == OVERCONFIDENT


def test_many_poses_make_no_verdict_of_ten_per_cent():
    assert judge(1.1, 1.05, 1.15).words == CONSISTENT
    assert judge(1.4, 1.3, 1.5).words == OVERCONFIDENT


def test_estimates_that_are_as_good_are_told_apart_in_at_most_one_of_ten_cases():
    apart = []
    for seed in range(300):
        pair = [np.sum(lasting(600, 0.8, seed=1000 * k + seed) ** 2, axis=1) for k in range(2)]
        found = compare(("a", "b"), *pair, draws=120.0)
        assert found.interval is not None
        apart.append(found.interval[0] > 1.0 or found.interval[1] < 1.0)
    assert np.mean(apart) <= 0.1


def test_a_pair_of_too_few_independent_errors_is_not_told_apart():
    series = np.sum(lasting(50, 0.0) ** 2, axis=1)
    found = compare(("a", "b"), 4.0 * series, series, draws=3.0)
    assert found.interval is None
    assert found.ratio == pytest.approx(4.0)
    assert "too few data" in found.told()


@pytest.mark.parametrize(
    ("interval_of", "dof", "words"),
    [((1.05, 1.22), 99.0, OVERCONFIDENT), ((1.05, 1.20), 99.0, CONSISTENT), ((0.84, 0.95), 99.0, CONSISTENT),
     ((0.81, 0.95), 99.0, CAUTIOUS), ((0.1, 0.9), 10.0, CAUTIOUS), ((0.1, 0.9), 9.9, TOO_FEW),
     ((0.67, 1.49), 99.0, CONSISTENT), ((0.66, 1.49), 99.0, TOO_FEW), ((0.67, 1.51), 99.0, TOO_FEW)],
)  # fmt: skip
def test_a_verdict_changes_where_its_bounds_say(interval_of, dof, words):
    assert judge(np.mean(interval_of), *interval_of, dof).words == words


def test_the_factor_of_a_cautious_estimate_is_stated_sigma_over_error():
    found = judge(0.25, 0.16, 0.64)
    assert found.factor == pytest.approx(2.0)
    assert found.factor_interval == pytest.approx((1.25, 2.5))


def test_from_ten_runs_on_the_interval_is_that_over_runs_and_needs_no_degrees_of_freedom():
    one = score(lasting(300, 0.0))
    runs = [replace(one, anees=0.1 + 0.01 * k, dof=0.5) for k in range(10)]
    found, fewer = pool(runs), pool(runs[:9])
    assert (found.low, found.high) == mean_interval(np.array([each.anees for each in runs]))
    assert found.verdict.words == CAUTIOUS
    assert (fewer.low, fewer.high) == interval(fewer.mean, 4.5)
    assert fewer.verdict.words == TOO_FEW


def test_a_pair_is_cut_into_stretches_of_four_lasting_errors_and_either_may_be_the_better():
    series = np.sum(lasting(400, 0.0) ** 2, axis=1)
    assert compare(("a", "b"), series, series, draws=120.0).blocks == 30
    assert compare(("a", "b"), series, series, draws=1e6).blocks == 100
    assert "no clear difference" in compare(("a", "b"), series, series, draws=120.0).told()
    for factor in (0.5, 2.0):
        assert "no clear difference" not in compare(("a", "b"), factor * series, series, draws=120.0).told()
