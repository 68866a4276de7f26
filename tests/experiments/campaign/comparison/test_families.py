"""Families of comparisons: p-values corrected by Holm's method, held against its definition."""

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.families import in_family, is_clear
from chainslam.experiments.scoring.statistics import FEW_RUNS


def by_definition(values):
    """Step down: the k-th smallest of m is multiplied by m - k, and never below one before it."""
    order, worst, found = sorted(range(len(values)), key=values.__getitem__), 0.0, [0.0] * len(values)
    for rank, k in enumerate(order):
        worst = max(worst, min(1.0, (len(values) - rank) * values[k]))
        found[k] = worst
    return found


@pytest.mark.parametrize("seed", range(5))
def test_each_comparison_is_corrected_for_all_that_are_tested(seed):
    rng = np.random.default_rng(seed)
    values = (rng.uniform(0, 1, 9) ** 3).tolist()
    rows = [{"p": p, "runs": FEW_RUNS} for p in values]
    found = in_family(rows)
    assert [row["p_holm"] for row in found] == pytest.approx(by_definition(values))
    assert {row["family"] for row in found} == {9}
    assert [is_clear(row) for row in found] == [row["p_holm"] < 0.05 for row in found]


def test_few_runs_are_not_tested_and_do_not_count():
    rows = [{"p": 0.01, "runs": FEW_RUNS}, {"p": 0.001, "runs": FEW_RUNS - 1}, {"p": None, "runs": 50}]
    found = in_family(rows)
    assert [row["p_holm"] for row in found] == [0.01, None, None]
    assert [row["family"] for row in found] == [1, 1, 1]
    assert not is_clear(found[1])
