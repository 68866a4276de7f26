"""Claims about a campaign are judged by its numbers, arm by arm."""

import pytest

from chainslam.experiments.campaign.comparison.findings import findings
from chainslam.experiments.campaign.comparison.tables import GATE, doubles
from chainslam.experiments.campaign.pages.tables import claims
from chainslam.experiments.campaign.runner import Tally
from chainslam.experiments.scoring.statistics import FEW_RUNS

BACKENDS = ("block-ekf", "full-ekf", "graph")
ARMS = ("closed", "replay-true")


def told(mean, low=None, high=None):
    return {"mean": mean, "low": low or mean, "high": high or mean, "low_buildings": None, "runs": 20}


def row(backend, arm="closed", **scores):
    good = {
        "trials": 20, "complete": 20, "sound": 20, "steps_outside_band": 0.0, "matches_false": 0, "double_entries": 1,
        "sightings": 1000, "distances": 500, "trace_least": 1.0, "trace_below": told(0.0), "bound_margin": 0.0,
        "bound_runs_below": 0, "bound_margin_median": None, "bound_first_m_median": None, "bound_worst_m_median": None,
        "pose_anees_from_start": told(1.0, 0.95, 1.05), "without": {"pose_anees_from_start": 0},
        "distances_in_95": told(0.95), "doubles_beyond_gate": told(-9.0),
    }  # fmt: skip
    return {"backend": backend, "arm": arm} | good | scores


def judged(pooled):
    """Whether each claim holds, by its kind, back end and arm."""
    said = findings(pooled, 0.99)
    return {(f["kind"], f["backend"], arm): cell["holds"] for f in said for arm, cell in f["arms"].items()}


def test_a_campaign_as_the_paper_would_have_it():
    bad = {
        "steps_outside_band": 0.9, "matches_false": 5, "trace_least": 0.01, "trace_below": told(0.99),
        "doubles_beyond_gate": told(3.0), "distances_in_95": told(0.6),
    }  # fmt: skip
    below = {"bound_margin": -0.1, "bound_runs_below": 20, "bound_margin_median": -0.05}
    pooled = [row("block-ekf", **bad), row("full-ekf", **below), row("graph"), row("graph", "replay-true")]
    pooled += [row(name, "replay-true") for name in ("block-ekf", "full-ekf")]
    holds = judged(pooled)
    for kind in ("outside", "wrong", "trace"):
        assert holds[kind, "block-ekf", "closed"]
    assert holds["margin", "graph", "closed"]
    assert holds["anees", "graph", "closed"]
    assert holds["held", "graph", "closed"]
    assert holds["held", "block-ekf", "closed"] is None
    assert [holds["doubles", name, "closed"] for name in BACKENDS] == [False, True, True]
    assert not holds["outside", "block-ekf", "replay-true"]
    assert ("wrong", "block-ekf", "replay-true") not in holds
    table = claims(ARMS, {"findings": findings(pooled, 0.99)})
    cells = {cells[:2]: cells[2:] for cells in table.rows}
    assert cells["outside its 95 % band for most of the run", "block-ekf"] == ("yes", "no")
    assert cells["more false matches and duplicate walls than any other", "block-ekf"] == ("yes", "–")
    assert cells["95 % intervals of distances hold the truth: how rarely", "block-ekf"] == ("–", "–")


@pytest.mark.parametrize(
    ("kind", "scores"),
    [
        ("anees", {"pose_anees_from_start": told(1.25, 1.15, 1.35)}),
        ("held", {"distances_in_95": told(0.92)}),
        ("margin", {"bound_margin": -1e-3}),
        ("doubles", {"doubles_beyond_gate": told(0.1)}),
    ],
)
def test_a_claim_that_a_number_contradicts_does_not_hold(kind, scores):
    assert judged([row("graph")])[kind, "graph", "closed"] is True
    assert judged([row("graph", **scores)])[kind, "graph", "closed"] is False


@pytest.mark.parametrize("ends", [(0.95, 1.15), (0.5, 1.0), (0.5, 2.0)])
def test_an_interval_partly_within_the_aim_leaves_the_claim_undecided(ends):
    pooled = [row("graph", pose_anees_from_start=told(1.0, *ends))]
    assert judged(pooled)["anees", "graph", "closed"] is None


@pytest.mark.parametrize(
    ("runs", "low", "holds"), [(FEW_RUNS, 0.95, True), (FEW_RUNS - 1, 0.95, None), (20, None, None)]
)
def test_an_interval_of_few_runs_or_none_leaves_the_claim_undecided(runs, low, holds):
    estimate = {"mean": 1.0, "low": low, "high": 1.05, "runs": runs}
    assert judged([row("graph", pose_anees_from_start=estimate)])["anees", "graph", "closed"] is holds


def test_a_back_end_without_a_scored_run_is_judged_by_nothing_and_one_that_limits_ended_by_its_scores():
    assert judged([row("graph", complete=0, sound=0)]) == {}
    assert judged([row("graph", complete=0)])["anees", "graph", "closed"] is True


def test_double_entries_are_held_against_what_the_gate_must_refuse():
    matches = {"matches_true": 1990, "matches_missed": 8, "matches_false": 2}
    found = doubles(matches | {"duplicate_lines": 1, "merges": 3, "false_merges": 1})
    assert found["sightings"] == 2000
    assert found["missed_share"] == pytest.approx(0.004)
    assert found["double_entries"] == 3
    assert found["doubles_beyond_gate"] == pytest.approx(3 - 2000 * (1 - GATE))
    assert set(doubles(matches).values()) == {None}


def test_the_rate_tells_how_many_computed_at_a_time():
    assert Tally(100, 50.0, 90.0).words().endswith("2.00 a second, computing time 1 min 30 s, 1.80 processes at a time")
    assert "already" in Tally(0, 0.1, 0.0).words()


WORDS = {
    ("outside", "block-ekf"): "outside its 95 % band for most of the run",
    ("wrong", "block-ekf"): "more false matches and duplicate walls than any other",
    ("trace", "block-ekf"): "comes to claim more than at its start",
    ("margin", "fej-ekf"): "never below the bound",
    ("margin", "invariant-ekf"): "never below the bound",
    ("margin", "graph"): "never below the bound",
    ("below", "full-ekf"): "below the bound: from where on, by how much",
    ("anees", "graph"): "interval of the mean pose ANEES from the start within 0.9 to 1.1",
    ("held", "graph"): "95 % intervals of distances hold the truth in 93 to 97 %",
    ("held", "block-ekf"): "95 % intervals of distances hold the truth: how rarely",
}


def test_each_claim_is_told_in_its_own_words():
    everyone = ("block-ekf", "full-ekf", "fej-ekf", "invariant-ekf", "graph")
    said = findings([row(name) for name in everyone], 0.995)
    doubles_of = {
        ("doubles", name): "no more duplicate walls than the 0.5 % that its gate must refuse" for name in everyone
    }
    assert {(f["kind"], f["backend"]): f["claim"] for f in said} == WORDS | doubles_of
    assert len(said) == len(WORDS) + len(doubles_of)


def one(kind, backend, **scores):
    (finding,) = [f for f in findings([row(backend, **scores)], 0.99) if f["kind"] == kind]
    return finding["arms"]["closed"]


@pytest.mark.parametrize(
    ("kind", "backend", "name", "value", "holds"),
    [
        ("outside", "block-ekf", "steps_outside_band", 0.5, False),
        ("outside", "block-ekf", "steps_outside_band", 0.501, True),
        ("outside", "block-ekf", "steps_outside_band", None, None),
        ("trace", "block-ekf", "trace_least", 1.0, False),
        ("trace", "block-ekf", "trace_least", 0.999, True),
        ("trace", "block-ekf", "trace_least", 1.5, False),
        ("trace", "block-ekf", "trace_least", None, None),
        ("margin", "graph", "bound_margin", -1e-6, True),
        ("margin", "graph", "bound_margin", -1.1e-6, False),
        ("margin", "graph", "bound_margin", None, None),
        ("anees", "graph", "pose_anees_from_start", told(1.0, 0.9, 1.1), True),
        ("anees", "graph", "pose_anees_from_start", told(1.0, 0.89, 1.1), None),
        ("anees", "graph", "pose_anees_from_start", told(1.0, 0.9, 1.11), None),
        ("anees", "graph", "pose_anees_from_start", told(0.8, 0.7, 0.9), None),
        ("anees", "graph", "pose_anees_from_start", told(0.8, 0.7, 0.89), False),
        ("anees", "graph", "pose_anees_from_start", told(1.2, 1.1, 1.3), None),
        ("anees", "graph", "pose_anees_from_start", told(1.2, 1.11, 1.3), False),
        ("anees", "graph", "pose_anees_from_start", None, None),
        ("held", "graph", "distances_in_95", told(0.93), True),
        ("held", "graph", "distances_in_95", told(0.97), True),
        ("held", "graph", "distances_in_95", told(0.929), False),
        ("held", "graph", "distances_in_95", told(0.971), False),
        ("held", "graph", "distances_in_95", None, None),
        ("held", "block-ekf", "distances_in_95", told(0.5), None),
        ("doubles", "graph", "doubles_beyond_gate", told(0.0), True),
        ("doubles", "graph", "doubles_beyond_gate", told(0.01), False),
        ("doubles", "graph", "doubles_beyond_gate", None, None),
    ],
)
def test_a_claim_holds_up_to_its_very_limit(kind, backend, name, value, holds):
    assert one(kind, backend, **{name: value})["holds"] is holds


def test_what_was_found_is_told_as_it_was_measured():
    assert one("trace", "block-ekf", trace_least=0.4, trace_below=told(0.7))["found"] == {"least": 0.4, "steps": 0.7}
    assert one("trace", "block-ekf", trace_least=None, trace_below=None)["found"] == {"least": None, "steps": None}
    held = one("held", "graph", distances_in_95=told(0.95), distances=500, complete=20)["found"]
    assert held == told(0.95) | {"distances": 500, "replays": 20}
    assert one("held", "graph", distances_in_95=None)["found"] == {"distances": 500, "replays": 20}
    numbers = {
        "bound_margin": -0.2, "bound_runs_below": 7, "bound_margin_median": -0.1, "bound_first_m_median": 3.0,
        "bound_worst_m_median": 9.0, "sound": 18,
    }  # fmt: skip
    assert one("below", "full-ekf", **numbers) == {"found": numbers, "holds": None}
    doubled = one("doubles", "graph", doubles_beyond_gate=told(-2.0, -3.0, -1.0), double_entries=4, sightings=600)
    assert doubled["found"] == {"double_entries": 4, "sightings": 600, "beyond_a_run": told(-2.0, -3.0, -1.0)}


def test_wrong_matches_are_held_against_the_worst_of_the_others_by_the_observation():
    """3 + 7 of 500 beside 2 + 3 of 250 and 4 + 1 of 1,000, the first of which are as many."""
    pooled = [
        row("block-ekf", matches_false=3, double_entries=7, sightings=500),
        row("full-ekf", matches_false=2, double_entries=3, sightings=250),
        row("graph", matches_false=4, double_entries=1, sightings=1000),
    ]
    worse = [row(name, "replay-own", matches_false=90, double_entries=0, sightings=100) for name in BACKENDS]
    (wrong,) = [f["arms"] for f in findings(pooled, 0.99) if f["kind"] == "wrong"]
    assert findings([*pooled, *worse], 0.99)[1]["arms"]["closed"] == wrong["closed"]
    assert wrong == {
        "closed": {
            "found": {"wrong": 10, "sightings": 500, "share": 0.02, "next": "full-ekf", "next_share": 0.02},
            "holds": False,
        }
    }
    pooled[1] |= {"matches_false": 1}
    (wrong,) = [f["arms"] for f in findings(pooled, 0.99) if f["kind"] == "wrong"]
    assert wrong["closed"]["holds"] is True
    assert (wrong["closed"]["found"]["next"], wrong["closed"]["found"]["next_share"]) == ("full-ekf", 0.016)


@pytest.mark.parametrize("observations", [(0, 100), (100, 0), (0, 0), (100, None)])
def test_without_observations_on_both_sides_there_is_nothing_to_hold_them_against(observations):
    pooled = [row("block-ekf", sightings=observations[0])]
    pooled += [] if observations[1] is None else [row("full-ekf", sightings=observations[1])]
    (wrong,) = [f["arms"]["closed"] for f in findings(pooled, 0.99) if f["kind"] == "wrong"]
    assert wrong == {"found": {"wrong": None, "sightings": observations[0]}, "holds": None}
