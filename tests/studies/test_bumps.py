"""The study of unreported turns: when a robot knows its pose again, and which steps lie outside the recovery."""

import numpy as np

from chainslam.sim.chance import Chance
from chainslam.sim.faults import bump_rad
from studies.robots.bumps import BumpsStudy, recoveries, table


def test_a_turn_is_recovered_from_at_the_first_step_that_knows_the_pose_again():
    knows = np.array([1, 1, 0, 0, 1, 1, 0, 1, 1, 0], dtype=bool)
    steps, outside = recoveries(np.array([2, 5, 6, 9]), knows)
    assert steps == [2, 0, 1, None]
    assert outside.tolist() == [True, True, False, False, True, True, False, True, True, False]
    assert recoveries(np.zeros(0, dtype=int), knows)[1].all()


def test_the_robot_is_turned_as_often_and_as_far_as_asked():
    faults = BumpsStudy(share=0.5, bump_deg=4.0).trial(180, 1).robot.faults
    turns = np.rad2deg([bump_rad(faults, Chance(1, 0), step) for step in range(400)])
    assert 0.4 < np.mean(turns != 0.0) < 0.6
    np.testing.assert_allclose(np.abs(turns[turns != 0.0]), 4.0)


def test_turns_are_counted_over_all_runs_of_a_scanner():
    plain = {"beams": 180, "status": "complete", "reason": "", "pose_anees": 1.0, "anees_outside": 1.0, "collisions": 0}
    lost = {"status": "failed", "reason": "lost at step 9: x", "recovered_after": [3, None], "anees_outside": 3.0}
    rows = [plain | {"recovered_after": [0, 20, 21, None]}, plain | lost]
    cells = [next(iter(column.cells)) for column in table(rows).columns]
    assert cells[:8] == ["180", "2", "1", "1", "6", "3 (50 %)", "12, 21", "1"]
    assert cells[9] == "2.00, 3.00"
