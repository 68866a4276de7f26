"""Claims about a campaign are judged by its numbers, arm by arm."""

import pytest

from experiments.campaign.finding_words import finding_table
from experiments.campaign.findings import findings
from experiments.campaign.plan import Campaign
from experiments.campaign.runner import Tally
from experiments.campaign.tables import GATE, doubles

BACKENDS = ("block-ekf", "full-ekf", "graph")
ARMS = ("closed", "replay-true")


def told(mean, low=None, high=None):
    return {"mean": mean, "low": low or mean, "high": high or mean, "low_buildings": None}


def row(backend, arm="closed", **scores):
    good = {
        "trials": 20, "complete": 20, "sound": 20, "steps_outside_band": 0.0, "matches_false": 0, "double_entries": 1,
        "sightings": 1000, "distances": 500, "trace_least": 1.0, "trace_below": told(0.0), "bound_margin": 0.0,
        "bound_runs_below": 0, "bound_margin_median": None, "bound_first_m_median": None, "bound_worst_m_median": None,
        "pose_anees": told(1.0, 0.95, 1.05), "distances_in_95": told(0.95), "doubles_beyond_gate": told(-9.0),
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
    table = finding_table(Campaign(("w",), BACKENDS, ("s",), 20, arms=ARMS), {"findings": findings(pooled, 0.99)})
    cells = {(cells[0], cells[1]): cells[2] for cells in table.rows}
    assert cells["outside its 95 % band for most of the run", "block-ekf"] == "yes: 90 % of the steps"
    assert cells["below the bound: from where on, by how much", "full-ekf"].startswith("20 of 20 runs: first after")


@pytest.mark.parametrize(
    ("kind", "scores"),
    [
        ("anees", {"pose_anees": told(1.25, 1.15, 1.35)}),
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
    pooled = [row("graph", pose_anees=told(1.0, *ends))]
    assert judged(pooled)["anees", "graph", "closed"] is None
    table = finding_table(Campaign(("w",), ("graph",), ("s",), 20, arms=ARMS), {"findings": findings(pooled, 0.99)})
    (cell,) = [cells[2] for cells in table.rows if "pose ANEES" in cells[0]]
    assert cell.startswith("too few runs to say: 1 (")


def test_a_back_end_without_a_complete_run_is_judged_by_nothing():
    assert judged([row("graph", complete=0)]) == {}


def test_double_entries_are_held_against_what_the_gate_must_refuse():
    matches = {"matches_true": 1990, "matches_missed": 8, "matches_false": 2}
    found = doubles(matches | {"duplicate_lines": 1, "merges": 3, "false_merges": 1})
    assert found["sightings"] == 2000
    assert found["missed_share"] == pytest.approx(0.004)
    assert found["double_entries"] == 3
    assert found["doubles_beyond_gate"] == pytest.approx(3 - 2000 * (1 - GATE))
    assert set(doubles(matches).values()) == {None}


def test_the_rate_tells_how_many_computed_at_a_time():
    assert Tally(100, 50.0, 90.0).words().endswith("2.00 a second, 90 s computed, 1.80 at a time")
    assert "already" in Tally(0, 0.1, 0.0).words()
