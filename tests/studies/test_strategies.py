"""The study of strategies: lengths to a share, ratios with intervals, and going on where it was interrupted."""

from dataclasses import replace

import numpy as np
import pytest

from studies.exploration import strategies as strategy_study
from studies.exploration.strategies import BASELINE, LENGTHS, SCORES, StrategyStudy, length_to, ratio


@pytest.mark.parametrize(("share", "expected"), [(0.0, 0.0), (0.4, 2.0), (0.5, 2.0), (0.9, 5.0), (0.95, None)])
def test_the_length_to_a_share_is_where_it_was_first_reached(share, expected):
    lengths, shares = np.array([0.0, 2.0, 3.0, 5.0]), np.array([0.1, 0.5, 0.4, 0.9])
    assert length_to(share, lengths, shares) == expected


def table(factor, noise, seeds=20):
    """Return lengths in two worlds; the other strategy drives `factor` times as far, give or take."""
    rng, rows = np.random.default_rng(1), []
    for world, length in (("a", 10.0), ("b", 200.0)):
        for seed in range(seeds):
            base = length * rng.uniform(0.8, 1.2)
            rows.append({"world": world, "strategy": BASELINE, "seed": seed, "m": base})
            rows.append({"world": world, "strategy": "other", "seed": seed, "m": base * factor * rng.normal(1, noise)})
    return rows


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
def test_a_ratio_lies_in_its_interval_which_is_narrow_for_pairs(factor):
    """Seeds differ by a fifth, pairs by one in fifty: only pairs find the narrow interval."""
    means, mean, low, high = ratio(table(factor, 0.02), "other", "m")
    assert set(means) == {"a", "b"}
    assert low < factor < high
    assert low < mean < high
    assert high / low < 1.03


def test_a_strategy_against_itself_is_exactly_one():
    assert ratio(table(2.0, 0.1), BASELINE, "m")[1:] == (1.0, 1.0, 1.0)


def test_trials_that_never_reached_the_share_are_left_out_in_pairs():
    rows = table(2.0, 0.0)
    rows = [row | {"m": None} if row["strategy"] == "other" and row["seed"] > 6 else row for row in rows]
    _, mean, low, high = ratio(rows, "other", "m")
    assert mean == pytest.approx(2.0)
    assert low == pytest.approx(high)


def test_a_handful_of_trials_has_no_interval():
    _, mean, low, high = ratio(table(2.0, 0.1, seeds=2), "other", "m")
    assert mean == pytest.approx(2.0, rel=0.2)
    assert np.isnan([low, high]).all()


def test_a_study_goes_on_where_it_was_interrupted_seed_by_seed(tmp_path, monkeypatch):
    ran = []

    def one(config):
        ran.append((config.world, config.strategy, config.seed))
        row = {"world": config.world, "strategy": config.strategy, "seed": config.seed, "errorless": config.errorless}
        return dict.fromkeys((*SCORES, *LENGTHS), 1.0) | row | {"status": "complete"}

    monkeypatch.setattr(strategy_study, "one", one)
    study = StrategyStudy(("paper-fig4", "hall"), ("frontier", BASELINE), 2, out=tmp_path / "rows" / "s.jsonl")
    assert [trial.seed for trial in study.trials()] == [1] * 4 + [2] * 4
    replace(study, worlds=("hall",), strategies=("frontier",), seeds=1).run()
    study.run()
    assert len(ran) == len(set(ran)) == 8
    assert ran[0] == ("hall", "frontier", 1)
    study.run()
    assert len(ran) == 8
