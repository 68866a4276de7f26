"""The table of faults: each is what its words say, and its table tells all of its runs."""

from chainslam.sim.faults import NEVER, FaultsConfig
from chainslam.sim.robot import RobotConfig
from studies.robots.faults import CASES, NAMES, ROWS, SOUND, FaultsStudy, table
from studies.runner.rows import last


def row(case, seed, **more):
    plain = {"status": "complete", "reason": "every chain is closed", "steps": 100, "coverage": 1.0, "collisions": 0}
    return {"case": case, "seed": seed, "pose_anees": 1.0, "map_anees": 2345.6, "lines": 72} | plain | more


def test_a_fault_is_told_by_both_its_runs_and_beside_the_same_seed_without_it():
    late = {"status": "failed", "reason": "at step 9: late", "steps": 50, "coverage": 0.25, "collisions": 1}
    rows = [
        row(SOUND, 2, steps=200),
        row("scans one step late", 2, **late),
        row(SOUND, 1),
        row("scans one step late", 1),
    ]
    _, sound, told = table(rows)
    assert sound[:4] == [SOUND, "complete", "100, 200", ""]
    assert told[1:5] == ["complete, failed", "100, 50", "1.00, 0.25", "0.250"]
    assert told[5:9] == ["1, 1", "2,350, 2,350", "72, 72", "0, 1"]
    assert told[9] == "every chain is closed; at step 9: late"


def test_a_case_is_the_robot_that_its_words_tell():
    assert CASES[SOUND] == FaultsConfig()
    assert len({repr(faults) for faults in CASES.values()}) == len(CASES)
    for case, faults in CASES.items():
        assert bool(faults.people.walking) == ("walk" in case)
        assert bool(faults.dropout) == ("dropouts" in case)
        assert faults.mirrored == ("mirrored" in case)
        assert bool(faults.late) == ("late" in case)
        assert (faults.frozen_from < NEVER) == ("repeats" in case)
        assert (faults.stuck_from < NEVER) == ("the robot stands" in case)
        trial = FaultsStudy(beams=90).trial(case, 3)
        assert (trial.seed, trial.robot.lidar.beams, trial.robot.faults) == (3, 90, faults)
        assert trial.robot.spec == RobotConfig().spec


def test_every_stored_row_is_of_a_case(request):
    rows = last(request.config.rootpath / ROWS, NAMES)
    assert rows
    assert {each["case"] for each in rows} <= set(CASES)
