"""Every number in comparison.json, against plain arithmetic on a handful of rows."""

import math
from itertools import product

import numpy as np
import pytest

from chainslam.experiments.campaign.comparison.comparison import (
    AT_MARKS,
    MEASURES,
    Measure,
    arm_of,
    cell_scores,
    compare,
    difference,
    runs_of,
    select,
)
from chainslam.experiments.campaign.plan import Campaign
from chainslam.experiments.scoring import statistics

BACKENDS = ("block-ekf", "full-ekf", "graph")
STRATEGIES = ("nearest-robot", "nearest-start")
ARMS = ("closed", "replay-true")
SEEDS = (1, 2, 3)
CAMPAIGN = Campaign(("a", "b"), BACKENDS, STRATEGIES, 3, arms=ARMS)
BACKEND_FACTOR = {"block-ekf": 3.0, "full-ekf": 1.0, "graph": 0.5}
STRATEGY_FACTOR = {"nearest-robot": 1.0, "nearest-start": 1.25}
ARM_FACTOR = {"closed": 1.0, "replay-true": 0.1}


def value(world, strategy, backend, arm, seed):
    """A value that tells its row, and that a swap of any two rows would change."""
    both = 2.0 if (backend, strategy) == ("block-ekf", "nearest-start") else 1.0
    both *= 1.5 if (arm, strategy) == ("replay-true", "nearest-start") else 1.0
    base = (1.0 + 0.1 * seed) * (2.0 if world == "b" else 1.0)
    return base * BACKEND_FACTOR[backend] * STRATEGY_FACTOR[strategy] * ARM_FACTOR[arm] * both


def row(world="a", strategy="nearest-robot", backend="full-ekf", arm="closed", seed=1, **more):
    names = {
        "world": world, "strategy": strategy, "backend": backend, "seed": seed, "status": "complete",
        "mode": "closed" if arm == "closed" else "replay", "association": "true" if arm == "replay-true" else "own",
    }  # fmt: skip
    x = value(world, strategy, backend, arm, seed)
    return names | {measure.name: x for measure in MEASURES} | more


ROWS = [row(*cell) for cell in product(("a", "b"), STRATEGIES, BACKENDS, ARMS, SEEDS)]
BANDS = [{"steps_outside_band": 0.01 * k, "pooled_anees": float(k)} for k in range(24)]


@pytest.fixture(autouse=True)
def _few_draws(monkeypatch):
    """Resample little: intervals are for test_statistics.py to judge."""
    monkeypatch.setattr(statistics, "DRAWS", 100)


@pytest.fixture
def said():
    return compare(CAMPAIGN, ROWS, [], BANDS)


def found(rows, **wanted):
    (only,) = [row for row in rows if all(row[key] == value for key, value in wanted.items())]
    return only


def test_a_back_end_is_compared_with_the_baseline_and_not_the_other_way_round(said):
    """Over both strategies: the geometric mean of three and of six times as much."""
    names, factors = ("pose_anees", "wall_rmse_m", "path_length_m"), {"block-ekf": 3.0 * 2.0**0.5, "graph": 0.5}
    for arm, name, (backend, times) in product(ARMS, names, factors.items()):
        told = found(said["backends"], arm=arm, first=backend, measure=name)
        assert (told["second"], told["kind"], told["runs"]) == ("full-ekf", "ratio", 6)
        assert told["value"] == pytest.approx(times)
        assert (told["low"], told["high"]) == pytest.approx((times, times))
        assert told["low_buildings"] is told["high_buildings"] is None
        assert told["first_better"] == float(times < 1.0)
        assert told["pairs_without_value"] == 0
    assert len(said["backends"]) == len(ARMS) * 2 * len(MEASURES)


def test_counts_are_compared_by_their_differences(said):
    told = found(said["backends"], arm="closed", first="block-ekf", measure="double_entries")
    off = []
    for world, seed in product(("a", "b"), SEEDS):
        sides = [[value(world, s, name, "closed", seed) for s in STRATEGIES] for name in ("block-ekf", "full-ekf")]
        off.append(sum(sides[0]) / 2 - sum(sides[1]) / 2)
    assert told["kind"] == "difference"
    assert told["value"] == pytest.approx(sum(off) / 6)
    spread = math.sqrt(sum((x - sum(off) / 6) ** 2 for x in off) / 5)
    assert told["effect_size"] == pytest.approx(sum(off) / 6 / spread)
    assert min(off) < told["low"] < told["value"] < told["high"] < max(off)
    assert told["p"] == statistics.estimate(dict(zip(product("ab", SEEDS), off, strict=True))).p


def test_a_strategy_is_compared_with_the_nearest_end(said):
    factors = {"block-ekf": 2.5, "full-ekf": 1.25, "graph": 1.25}
    for arm, (backend, times) in product(ARMS, factors.items()):
        told = found(said["strategies"], arm=arm, backend=backend, measure="ate_m")
        assert (told["first"], told["second"]) == ("nearest-start", "nearest-robot")
        assert told["value"] == pytest.approx(times * (1.5 if arm == "replay-true" else 1.0))
    assert len(said["strategies"]) == len(ARMS) * len(BACKENDS) * len(MEASURES)


def test_the_interaction_is_what_a_strategy_does_to_a_back_end_over_what_it_does_to_the_baseline(said):
    for arm in ARMS:
        told = found(said["interaction"], arm=arm, backend="block-ekf", measure="map_anees")
        assert (told["strategy"], told["kind"], told["runs"]) == ("nearest-start", "ratio of ratios", 6)
        assert told["value"] == pytest.approx(2.0)
        assert found(said["interaction"], arm=arm, backend="graph", measure="map_anees")["value"] == pytest.approx(1.0)
    told = found(said["interaction"], arm="closed", backend="block-ekf", measure="false_matches")
    assert told["kind"] == "difference of differences"
    gains = []
    for world, seed in product(("a", "b"), SEEDS):
        of = {(b, s): value(world, s, b, "closed", seed) for b in BACKENDS for s in STRATEGIES}
        gain = {b: of[b, "nearest-start"] - of[b, "nearest-robot"] for b in BACKENDS}
        gains.append(gain["block-ekf"] - gain["full-ekf"])
    assert told["value"] == pytest.approx(sum(gains) / 6)
    assert len(said["interaction"]) == len(ARMS) * 2 * len(MEASURES)


def test_the_interaction_counts_the_runs_of_its_own_arm_in_which_it_has_no_value():
    rows = [r for r in ROWS if (arm_of(r), r["seed"]) != ("replay-true", 3)]
    broken = [("closed", "a", 1), ("closed", "b", 2)]
    rows = [
        r | {"status": "failed"} if r["backend"] == "graph" and (arm_of(r), r["world"], r["seed"]) in broken else r
        for r in rows
    ]
    told = [r for r in compare(CAMPAIGN, rows, [], BANDS)["interaction"] if r["measure"] == "ate_m"]
    without = {(r["arm"], r["backend"]): (r["runs"], r["pairs_without_value"]) for r in told}
    assert without == {
        ("closed", "block-ekf"): (6, 0), ("closed", "graph"): (4, 2),
        ("replay-true", "block-ekf"): (4, 0), ("replay-true", "graph"): (4, 0),
    }  # fmt: skip


def test_without_a_baseline_nothing_is_compared():
    rows = [r for r in ROWS if r["backend"] == "graph"]
    said = compare(Campaign(("a", "b"), ("graph",), STRATEGIES, 3, arms=ARMS), rows, [], BANDS[:8])
    assert said["backends"] == said["interaction"] == []
    assert len(said["strategies"]) == len(ARMS) * len(MEASURES)
    rows = [r for r in ROWS if r["strategy"] == "nearest-start"]
    said = compare(Campaign(("a", "b"), BACKENDS, ("nearest-start",), 3, arms=ARMS), rows, [], BANDS[:12])
    assert said["strategies"] == said["interaction"] == []
    assert len(said["backends"]) == len(ARMS) * 2 * len(MEASURES)


def test_cells_keep_the_order_of_the_trials_and_their_own_bands(said):
    cells = said["cells"]
    names = [tuple(cell[key] for key in ("world", "strategy", "backend", "arm")) for cell in cells]
    assert names == list(product(("a", "b"), STRATEGIES, BACKENDS, ARMS))
    assert [cell["pooled_anees"] for cell in cells] == list(range(24))
    for name, cell in zip(names, cells, strict=True):
        values = [value(*name, seed) for seed in SEEDS]
        assert (cell["trials"], cell["complete"], cell["sound"]) == (3, 3, 3)
        assert cell["ate_m"]["mean"] == pytest.approx(sum(values) / 3)
        assert cell["ate_m"]["median"] == pytest.approx(values[1])
        assert cell["ate_m"]["runs"] == 3
    with pytest.raises(ValueError, match="argument"):
        compare(CAMPAIGN, ROWS, [], BANDS[:-1])


def test_a_back_end_is_pooled_over_worlds_and_strategies_arm_by_arm(said):
    assert [(r["arm"], r["backend"]) for r in said["pooled"]] == list(product(ARMS, BACKENDS))
    for told in said["pooled"]:
        runs = [
            sum(value(world, s, told["backend"], told["arm"], seed) for s in STRATEGIES) / 2
            for world, seed in product(("a", "b"), SEEDS)
        ]
        assert told["trials"] == 12
        assert told["pose_anees"]["mean"] == pytest.approx(sum(runs) / 6)
        assert told["pose_anees"]["runs"] == 6
        mine = [
            c["steps_outside_band"] for c in said["cells"] if (c["arm"], c["backend"]) == (told["arm"], told["backend"])
        ]
        assert told["steps_outside_band"] == pytest.approx(sum(mine) / 4)


def test_counts_tell_how_trials_ended():
    rows = [row(seed=seed, status=status) for seed, status in enumerate(("complete", "failed", "complete", "stopped"))]
    said = compare(Campaign(("a",), ("full-ekf",), ("nearest-robot",), 4), rows, [], [{"steps_outside_band": None}])
    assert said["counts"] == {"trials": 4, "complete": 2, "stopped": 1, "failed": 1}
    assert said["pooled"][0]["steps_outside_band"] is None


def test_an_arm_is_named_by_its_mode_and_for_a_replay_by_its_association():
    closed = {"mode": "closed", "association": "own"}
    assert arm_of(closed) == "closed"
    assert arm_of({"mode": "replay", "association": "own"}) == "replay-own"
    assert arm_of({"mode": "replay", "association": "true"}) == "replay-true"
    rows = [closed | {"k": 1}, closed | {"k": 2}, {"mode": "replay", "association": "true", "k": 1}]
    assert select(rows, k=1) == [rows[0], rows[2]]
    assert select(rows, arm="closed") == rows[:2]
    assert select(rows, arm="replay-true", k=2) == []


def test_the_runs_of_a_measure_are_those_that_ended_as_wanted_and_have_it():
    rows = [
        row(seed=1, x=2.0), row(seed=1, strategy="nearest-start", x=8.0), row(seed=2, x=None), row(seed=3, x=math.nan),
        row(seed=4, x=3.0, status="stopped"), row(seed=7, x=3.0, status="failed"),
        row(seed=5, x=0.0), row(seed=6, x=math.inf), row("b", seed=1, x=5.0),
    ]  # fmt: skip
    assert runs_of(rows, Measure("x", False)) == {("a", 1): 5.0, ("a", 4): 3.0, ("a", 5): 0.0, ("b", 1): 5.0}
    logs = runs_of(rows, Measure("x", True))
    assert logs == pytest.approx({("a", 1): math.log(4.0), ("a", 4): math.log(3.0), ("b", 1): math.log(5.0)})
    # A path that a limit cut off is no length of an exploration.
    paths = [row(seed=1, path_length_m=2.0), row(seed=2, path_length_m=3.0, status="stopped")]
    assert runs_of(paths, Measure("path_length_m", False)) == {("a", 1): 2.0}
    lifted = runs_of(rows, Measure("x", True, 0.5))
    assert lifted["a", 5] == pytest.approx(math.log(0.5))
    assert lifted["a", 1] == pytest.approx((math.log(2.5) + math.log(8.5)) / 2)
    assert runs_of(rows, Measure("not there", False)) == {}
    # A floor lifts what is zero, and what is below it stays out.
    assert runs_of([row(x=-0.5), row(seed=2, x=-0.25)], Measure("x", True, 0.5)).keys() == {("a", 2)}


def test_a_difference_of_runs_that_share_none_has_no_value():
    told = difference([row(seed=1)], [row(seed=2)], Measure("ate_m", True))
    assert {key: told[key] for key in ("measure", "kind", "value", "low", "high", "runs", "pairs_without_value")} == {
        "measure": "ate_m", "kind": "ratio", "value": None, "low": None, "high": None, "runs": 0,
        "pairs_without_value": 2,
    }  # fmt: skip
    assert told["first_better"] == 0.5


def test_the_interval_over_buildings_is_told_as_a_ratio_too():
    worlds = "abcdef"
    first = [row("a", seed=s) | {"world": w, "ate_m": 2.0 * (k + s)} for k, w in enumerate(worlds) for s in (1, 2)]
    second = [row("a", seed=s) | {"world": w, "ate_m": 1.0 * (k + s)} for k, w in enumerate(worlds) for s in (1, 2)]
    told = difference(first, second, Measure("ate_m", True))
    assert [told[key] for key in ("value", "low", "high", "low_buildings", "high_buildings")] == pytest.approx(
        5 * [2.0]
    )
    # Rounding alone spreads a ratio that is the same in all runs: no effect size can be held against it.
    told = difference(first, second, Measure("ate_m", False))
    assert told["low_buildings"] < told["value"] < told["high_buildings"]


def marked(seed, state, arm="closed", **scores):
    status = "complete" if state != "failed" else "stopped"
    return row(seed=seed, arm=arm, status=status) | {"metres": "10", "state": state} | scores


def test_at_a_mark_runs_that_failed_before_are_counted_and_in_no_mean():
    scores = {name: 1.0 + k for k, name in enumerate(AT_MARKS)}
    rows = [
        marked(1, "driving", **scores), marked(2, "finished", **{name: 3.0 * x for name, x in scores.items()}),
        marked(3, "failed", **{name: 100.0 for name in scores}), marked(4, "driving", **dict.fromkeys(scores)),
        marked(1, "driving", "replay-true", **scores), marked(1, "driving", **scores) | {"metres": "20"},
    ]  # fmt: skip
    told = compare(CAMPAIGN, [], rows, [])["marks"]
    assert [f"{cell['arm']} {cell['metres']}" for cell in told] == ["closed 10", "replay-true 10", "closed 20"]
    assert told[0] == {
        "world": "a", "strategy": "nearest-robot", "backend": "full-ekf", "arm": "closed", "metres": "10",
        "driving": 2, "finished": 1, "failed": 1,
        "without": dict.fromkeys(("pose_anees_so_far", "map_anees", "wall_rmse_m", "wall_shape_m"), 1),
    } | {name: pytest.approx(2.0 * x) for name, x in scores.items()}  # fmt: skip


def test_a_cell_adds_up_and_averages_the_runs_that_did_not_fail():
    numbers = {
        "duplicate_lines": 1, "false_matches": 2, "matches_true": 3, "matches_missed": 4, "matches_false": 5,
        "merges": 6, "false_merges": 7, "sightings": 8, "double_entries": 9,
    }  # fmt: skip
    shares = {"distances_in_95": 0.9, "trace_below": 0.2, "missed_share": 0.1, "doubles_beyond_gate": 3.0}
    complete = row(seed=1, **numbers, **shares, distances=50, pose_nees_in_band=0.8, trace_least=0.7, bound_margin=0.0)
    stopped = row(seed=2, status="stopped", **{key: 10 * x for key, x in numbers.items()},
                  **{key: 2.0 * x for key, x in shares.items()}, distances=500, pose_nees_in_band=0.2,
                  trace_least=0.4, bound_margin=-0.3, bound_first_m=4.0, bound_worst_m=9.0)  # fmt: skip
    other = row(seed=4, **{key: None for key in (*numbers, "map_anees", "trace_least", "distances")},
                pose_nees_in_band=0.6, bound_margin=-0.1, bound_first_m=2.0, bound_worst_m=3.0)  # fmt: skip
    failed = row(seed=3, status="failed", **numbers, **shares, distances=50, trace_least=0.0, bound_margin=-9.0,
                 bound_first_m=0.1)  # fmt: skip
    told = cell_scores([complete, stopped, other, failed])
    assert {key: told[key] for key in numbers} == {key: 11 * x for key, x in numbers.items()}
    assert (told["trials"], told["complete"], told["sound"], told["distances"]) == (4, 2, 3, 550)
    assert told["distances_in_95"]["mean"] == pytest.approx(1.35)
    assert told["trace_below"]["mean"] == pytest.approx(0.3)
    assert told["missed_share"]["mean"] == pytest.approx(0.15)
    assert told["doubles_beyond_gate"]["mean"] == pytest.approx(4.5)
    assert told["pose_nees_in_band"] == pytest.approx(1.6 / 3)
    assert (told["trace_least"], told["bound_margin"]) == (0.4, -0.3)
    assert told["bound_runs_below"] == 2
    assert (told["bound_margin_median"], told["bound_first_m_median"]) == (pytest.approx(-0.2), 3.0)
    assert told["bound_worst_m_median"] == 6.0
    assert (told["without"]["map_anees"], told["without"]["wall_rmse_m"]) == (1, 0)
    assert told["ate_m"]["mean"] == pytest.approx(
        np.mean([value("a", "nearest-robot", "full-ekf", "closed", s) for s in (1, 2, 4)])
    )
    assert told["path_length_m"]["runs"] == 2
    assert (told["verdict"], told["factor"], told["what"]) == ("too few runs", None, None)
    empty = cell_scores([failed])
    assert (empty["complete"], empty["sound"], empty["double_entries"], empty["distances"]) == (0, 0, 0, 0)
    nothing = ("ate_m", "missed_share", "trace_least", "bound_margin", "bound_margin_median", "pose_nees_in_band")
    assert [empty[key] for key in nothing] == 6 * [None]
    assert empty["bound_runs_below"] == 0
