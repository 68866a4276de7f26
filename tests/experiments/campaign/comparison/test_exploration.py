"""How soon strategies see the floor, against plain arithmetic on a few rows."""

import pytest

from chainslam.experiments.campaign.comparison.exploration import exploration
from chainslam.experiments.campaign.pages.tables import EXPLORED
from chainslam.experiments.scoring.maps.swept import SOON
from chainslam.viz.reports.report import table


def trial(seed, strategy, at_90, at_99, **more):
    """A run whose time, path and scans to a share are this number, twice and four times it; None for never."""
    values = [None if at is None else factor * at for at in (at_90, at_99) for factor in (1, 2, 4)]
    names = {"world": "a", "backend": "graph", "strategy": strategy, "seed": seed, "mode": "closed"}
    return names | {"status": "complete", "association": "own"} | dict(zip(SOON, values, strict=True)) | more


ROWS = [
    *(trial(seed, "frontier", 10.0 + seed, 20.0 + seed) for seed in range(1, 6)),
    trial(1, "adaptive", 30.0, None, status="stopped"),
    trial(2, "adaptive", 40.0, 60.0),
    trial(3, "adaptive", 999.0, 999.0, status="failed"),
    trial(4, "adaptive", None, None),
    trial(1, "adaptive", 999.0, 999.0, mode="replay"),
]


def test_means_are_over_the_runs_in_closed_loop_that_saw_so_much():
    frontier, adaptive = exploration(ROWS)
    assert (frontier["strategy"], adaptive["strategy"], adaptive["backend"]) == ("frontier", "adaptive", "graph")
    assert [frontier[key] for key in ("sound", "reached_90", "reached_99")] == [5, 5, 5]
    assert [adaptive[key] for key in ("sound", "reached_90", "reached_99")] == [3, 2, 1]
    assert [frontier[key]["mean"] for key in SOON] == pytest.approx([13.0, 26.0, 52.0, 23.0, 46.0, 92.0])
    assert [adaptive[key]["mean"] for key in SOON] == pytest.approx([35.0, 70.0, 140.0, 60.0, 120.0, 240.0])
    assert frontier["swept_90_s"]["low"] < 13.0 < frontier["swept_90_s"]["high"]
    assert adaptive["swept_90_s"]["low"] is None


def test_the_table_counts_runs_and_has_a_dash_where_none_saw_so_much():
    rows = exploration([*ROWS, trial(1, "uncertainty", 5.0, None)])
    shown = table("t", EXPLORED, rows)
    cells = {row[0]: dict(zip(shown.header, row, strict=True)) for row in shown.rows}
    assert (cells["adaptive"]["90 % seen"], cells["adaptive"]["99 % seen"]) == ("2 of 3", "1 of 3")
    assert cells["frontier"]["time to 90 %, s"].startswith("13.0 (")
    assert cells["adaptive"]["path to 99 %, m"] == "120"
    assert cells["uncertainty"]["scans to 99 %"] == "–"
    assert exploration([]) == exploration([trial(1, "frontier", 1.0, 2.0, mode="replay")]) == []
