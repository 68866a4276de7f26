"""Courts: every room can be reached from a start in the blind; which ends of a run are premature."""

import json

import numpy as np
import pytest

from chainslam.sim.worlds import load
from chainslam.slam.geometry.lines import distance_to_segments
from studies.exploration.court_worlds import court
from studies.exploration.courts import CourtsStudy, is_premature


@pytest.mark.parametrize("seed", [1, 2, 7])
def test_a_court_is_one_building_in_whose_middle_no_wall_is_in_sight(seed, tmp_path):
    file = tmp_path / "court.json"
    file.write_text(json.dumps(court(seed)))
    world = load(str(file))
    assert distance_to_segments(world.start[None, :2], world.faces).min() > 2 * 3.5
    assert world.reachable().area > 0.85 * world.free.area > 500.0
    assert court(seed) == court(seed) != court(seed + 1)


def test_all_buildings_have_one_seed_before_any_has_the_next(tmp_path):
    trials = CourtsStudy(buildings=2, seeds=2, out=tmp_path / "rows.jsonl").trials()
    assert [(trial.world[-6], trial.seed) for trial in trials] == [("1", 1), ("2", 1), ("1", 2), ("2", 2)]
    assert np.array(json.loads((tmp_path / "court-2.json").read_text())["walls"]).shape[1] == 4


@pytest.mark.parametrize(
    ("status", "swept", "early"),
    [("complete", 0.89, True), ("complete", 0.91, False), ("failed", 0.2, False), ("stopped", 0.2, False)],
)
def test_only_a_run_that_says_complete_is_premature(status, swept, early):
    assert is_premature({"status": status, "swept": swept}) == early
