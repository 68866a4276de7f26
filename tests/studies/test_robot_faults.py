"""The table of faults: each is what its words say, and the page has the table that the stored rows make."""

import pytest

from chainslam.sim.faults import NEVER, FaultsConfig
from chainslam.sim.robot import RobotConfig
from studies.robots.faults import CASES, NAMES, SOUND, FaultsStudy, lines_of, with_table
from studies.runner.rows import read


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
    _, _, sound, told = (line.strip("| ").split(" | ") for line in lines_of(rows))
    assert sound[:4] == [SOUND, "complete", "100, 200", ""]
    assert told[1:5] == ["complete, failed", "100, 50", "1.00, 0.25", "0.250"]
    assert told[5:9] == ["1, 1", "2,346, 2,346", "72, 72", "0, 1"]
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


def test_only_what_lies_between_the_marks_is_written_anew():
    page = "before\n<!-- made by `make robots`: begins -->\nold\n<!-- made by `make robots`: ends -->\nafter\n"
    once = with_table(page, ["| new |"])
    assert once == page.replace("old", "| new |")
    assert with_table(once, ["| new |"]) == once
    with pytest.raises(ValueError, match="unpack"):
        with_table("no marks", [])


def test_the_page_has_the_table_of_the_stored_rows(request):
    root = request.config.rootpath
    study = FaultsStudy()
    rows = read(root / study.out, NAMES, any_code=True)
    newest = {tuple(each[name] for name in NAMES): each for each in rows}
    page = (root / study.page).read_text()
    assert with_table(page, lines_of(list(newest.values()))) == page
    assert rows
    assert {each["case"] for each in rows} <= set(CASES)
