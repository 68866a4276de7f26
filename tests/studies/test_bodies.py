"""The table of bodies: a robot is held against the paper's in the same building, seed by seed."""

from chainslam.experiments.scenario import load_world
from studies.robots.bodies import CASES, PAPER, BodiesStudy, fits, table


def row(case, world, seed, steps, **more):
    plain = {"status": "complete", "coverage": 1.0, "contours_closed": 3, "contours_reachable": 3, "collisions": 0}
    own = {"case": case, "world": world, "seed": seed, "steps": steps, "pose_anees": 1.0, "map_anees": None}
    return own | plain | more


def test_steps_are_told_over_those_of_the_papers_robot_in_the_same_building():
    wide = "radius 0.3 m"
    rows = [
        row(PAPER, "rooms", 1, 100), row(wide, "rooms", 1, 200, collisions=2), row(PAPER, "rooms", 2, 400),
        row(wide, "rooms", 2, 200, status="stopped", coverage=0.5), row(wide, "flat", 1, 100),
    ]  # fmt: skip
    cells = [list(column.cells) for column in table(rows).columns]
    assert cells[0] == [PAPER, wide, wide]
    assert cells[1] == ["rooms", "rooms", "flat"]
    assert cells[2] == ["2 of 2", "1 of 2", "1 of 1"]
    assert cells[6] == ["", "1.00", ""]
    assert cells[9] == ["0", "2", "0"]


def test_a_case_is_the_robot_that_its_name_tells():
    for name, robot in CASES.items():
        assert f"{robot.radius_m:g}" in name or not robot.scanner.is_at_axle
        assert BodiesStudy().trial(name, "rooms", 3).mission.explorer.following.paths.robot == robot.spec


def test_a_building_fits_a_body_that_gets_through_its_doors():
    world = load_world("rooms")
    assert fits(world, 0.1)
    assert not fits(world, 0.6)
