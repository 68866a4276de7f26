"""Intervals and tests hold their level, by the study that draws campaigns of known mean."""

import jaxtyping
import numpy as np
import pytest

from chainslam.experiments.scoring import statistics
from chainslam.experiments.scoring.statistics import estimate, holm
from studies.results.levels import DRAWS_OF, FAMILY, LevelStudy, held, of_buildings, of_runs, outside_band

CASES = 400


@pytest.fixture(autouse=True)
def _cheaply(monkeypatch):
    """Without the shape checks that pytest adds, and with fewer resamples: both cost more than what is judged here."""
    monkeypatch.setattr(statistics, "DRAWS", 1000)
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


def is_at(share, level, cases=CASES):
    """Whether a share of so many cases is that of the level, give or take three standard deviations."""
    return abs(share - level) < 3.0 * np.sqrt(level * (1.0 - level) / cases)


@pytest.mark.parametrize(("kind", "count"), [("normal", 5), ("chi-square, 3 degrees", 10), ("exponential", 10)])
def test_the_interval_by_run_holds_the_mean_of_few_and_skewed_values_in_95_of_100_campaigns(kind, count):
    rng = np.random.default_rng(3)
    assert is_at(held([of_runs(rng, DRAWS_OF[kind], count) for _ in range(CASES)])[0], 0.95)


@pytest.mark.long
@pytest.mark.parametrize("count", [5, 10, 20])
@pytest.mark.parametrize("kind", DRAWS_OF)
def test_over_many_campaigns_93_to_97_of_100_intervals_hold_the_mean(kind, count):
    """Of five exponential values 0.93 is the very edge."""
    rng = np.random.default_rng(4)
    share = held([of_runs(rng, DRAWS_OF[kind], count) for _ in range(4000)])[0]
    assert (0.92 if count == 5 else 0.93) <= share <= 0.97


@pytest.mark.parametrize("spread", [0.0, 1.0, 2.0])
def test_the_interval_by_building_holds_the_mean_whether_buildings_differ_or_not(spread):
    """Where they do, that by run holds for these buildings only: six of them on ten seeds are not sixty draws."""
    rng = np.random.default_rng(5)
    by_run, by_building = held([of_buildings(rng, 6, 10, spread) for _ in range(CASES)])
    assert is_at(by_building, 0.95)
    assert by_run < 0.8 if spread else is_at(by_run, 0.95)


@pytest.mark.parametrize("buildings", [2, 6])
def test_a_p_value_below_a_level_is_as_rare_as_the_level_says(buildings, monkeypatch):
    monkeypatch.setattr(statistics, "DRAWS", 2)
    rng = np.random.default_rng(9)
    campaigns = [of_buildings(rng, buildings, 10, 0.0) for _ in range(CASES)]
    ps = np.array([estimate({run: value - 1.0 for run, value in values.items()}).p for values in campaigns])
    for level in (0.05, 0.2):
        assert is_at(np.mean(ps < level), level)


def test_chance_alone_makes_a_comparison_of_a_family_clear_in_one_family_of_twenty():
    """Uncorrected, nearly every family of this size has one."""
    families = np.random.default_rng(10).uniform(size=(CASES, FAMILY))
    assert is_at(np.mean([(holm(family.tolist()) < 0.05).any() for family in families]), 0.05)
    assert np.mean((families < 0.05).any(axis=1)) > 0.9


def test_the_pooled_band_holds_an_ideal_estimate_however_long_its_errors_last():
    """Where an error lasts as long as the run 5 of 100 campaigns lie outside; where it passes, fewer."""
    rng = np.random.default_rng(6)
    assert is_at(np.mean([outside_band(rng, 20, 50, 1.0) for _ in range(CASES)]), 0.05)
    assert np.mean([outside_band(rng, 20, 50, 0.3) for _ in range(CASES)]) < 0.05


def test_the_study_prints_a_row_for_each_kind_of_campaign(capsys):
    LevelStudy(counts=(5,), cases=4).run()
    found = capsys.readouterr().out
    assert all(name in found for name in DRAWS_OF)
    assert "families of 77 comparisons" in found
