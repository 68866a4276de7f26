"""The study of apartments by a scanner of 541 beams: its robot is the one asked for, and its table tells each plan."""

import numpy as np

from chainslam.sim.robot import RobotConfig
from studies.robots.apartments import ROBOT, ApartmentsStudy, table


def test_every_fourth_plan_by_name_is_driven_by_the_robot_that_was_asked_for(tmp_path):
    for name in "hgfedcba":
        (tmp_path / f"lifull_{name}.json").touch()
    trials = ApartmentsStudy(tmp_path).trials()
    assert [trial.world[-6:] for trial in trials] == ["a.json", "e.json"]
    lidar = ROBOT.lidar
    assert (lidar.beams, lidar.range_max_m, lidar.sigma_m, ROBOT.faults.dropout) == (541, 10.0, 0.015, 0.01)
    assert np.isclose(lidar.fov_rad, np.deg2rad(270.0))
    assert ROBOT.spec == RobotConfig().spec


def test_a_run_that_could_not_be_scored_has_a_row():
    whole = {"world": "a", "status": "complete", "coverage": 0.99, "contours_closed": 1, "contours_reachable": 2}
    rows = [whole | {"steps": 9, "pose_anees": 1.0, "map_anees": None, "collisions": 0, "processor_s": 3.0}]
    rows.append({"world": "b", "status": "failed", "reason": "ValueError: x"})
    cells = [list(column.cells) for column in table(rows).columns]
    assert cells[1] == ["complete", "failed"]
    assert cells[3] == ["1 of 2", "None of None"]
    assert cells[6] == ["-", "-"]
