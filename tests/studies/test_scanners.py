"""The table of scanners: a fault is held against the same scanner without it, seed by seed."""

from studies.robots.scanners import ScannersStudy, cases, table


def row(case, seed, steps, **more):
    plain = {"status": "complete", "coverage": 1.0, "contours_closed": 3, "contours_reachable": 3, "collisions": 0}
    plain |= {"unstated_motions": 1, "lost_steps": 0, "wheel_noise_factor": 1.0}
    return {"case": case, "seed": seed, "steps": steps, "pose_anees": 1.0, "map_anees": 2.0} | plain | more


def test_steps_are_told_over_those_of_the_same_seed_without_the_fault():
    rows = [
        row("360 beams", 1, 100), row("360 beams", 2, 400), row("360 beams; 5 % dropouts", 1, 200),
        row("360 beams; 5 % dropouts", 2, 200, status="stopped", coverage=0.5, contours_closed=1, collisions=2),
    ]  # fmt: skip
    shown = table(rows)
    cells = [list(column.cells) for column in shown.columns]
    assert cells[0] == ["360 beams", "360 beams; 5 % dropouts"]
    assert cells[1:6] == [["2 of 2", "1 of 2"], ["1.000", "0.500"], ["6 of 6", "4 of 6"], ["250", "200"], ["", "1.00"]]
    assert cells[8] == ["0", "2"]


def test_a_case_is_the_robot_that_its_name_tells():
    robots = cases()
    assert {name.partition(";")[0] for name in robots} <= robots.keys()
    for name, robot in robots.items():
        assert (robot.faults.dropout > 0) == ("dropouts" in name)
        assert (robot.faults.mixed > 0) == ("mixed" in name)
        assert (robot.faults.bump > 0) == ("bumps" in name)
        assert (robot.faults.slip > 1) == ("slip" in name)
        assert (robot.lidar.sigma_share > 0) == ("noise of" in name)
        assert f"{robot.lidar.beams:,} beams" in name
        assert ScannersStudy().trial(name, 3).robot == robot


def test_the_step_at_which_worse_wheels_were_noticed_is_told_where_all_runs_did():
    slip = "541 beams; slip of three times"
    rows = [row(slip, 1, 100, wheel_noise_step=4), row(slip, 2, 100, wheel_noise_step=9), row("541 beams", 1, 100)]
    cells = [list(column.cells) for column in table(rows).columns]
    assert cells[12] == ["9", ""]
    assert list(table([*rows, row(slip, 3, 100, wheel_noise_step=None)]).columns[12].cells) == ["", ""]
