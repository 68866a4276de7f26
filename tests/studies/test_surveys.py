"""The study of second looks against the truth: walls bow as told, a run has its scores."""

import numpy as np
import shapely

from chainslam.sim.worlds import load
from studies.logs.surveys import SurveyStudy, bowed, table


def test_walls_bow_by_so_much_and_corners_stay():
    world = load("rooms")
    bent = bowed(world, 0.02, 1)
    assert bowed(world, 0.0, 1) is world
    corners = shapely.get_coordinates(world.free)
    points = shapely.get_coordinates(bent.free)
    away = shapely.distance(world.free.boundary, shapely.points(points))
    assert all(np.hypot(*(points - corner).T).min() < 1e-9 for corner in corners)
    moved = away[away > 1e-9]
    assert len(moved) > 30
    assert 0.014 < np.sqrt(np.mean(moved**2)) < 0.026
    assert np.hypot(*np.diff(shapely.get_coordinates(bent.free.exterior), axis=0).T).max() < 1.6


def test_a_run_has_its_scores_and_the_table_a_row(tmp_path, capsys):
    SurveyStudy(("paper-fig8",), (0.0,), 1, out=tmp_path / "rows.jsonl").run()
    assert "paper-fig8" in capsys.readouterr().out
    score = {"count": 9, "anees": 2.0, "median": 1.5, "in_band": 0.9, "error_m": 0.3, "stated_m": 0.1}
    rows = [{"world": "hall", "bow_m": 0.0, "seed": k, "poses": score, "relations": score} for k in (1, 2)]
    rows[1] |= {"poses": score | {"anees": 4.0, "error_m": 0.4}}
    cells = [next(iter(column.cells)) for column in table(rows).columns]
    assert cells == [
        "hall",
        "0",
        "2",
        "3.00",
        "1.50",
        "0.90",
        "0.354",
        "0.100",
        "2.00",
        "1.50",
        "0.90",
        "0.300",
        "0.100",
    ]
