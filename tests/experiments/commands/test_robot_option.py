"""`--robot`: a robot by name or from a file, under --config, --set and options."""

import json
from dataclasses import fields

import numpy as np
import pytest

from chainslam.experiments.artifacts.presets import robot_of, stated
from chainslam.experiments.artifacts.saved import read_trial
from chainslam.experiments.artifacts.settings import parse_setting, trial_of
from chainslam.experiments.commands.campaigns.compare import Compare
from chainslam.experiments.commands.cli import main
from chainslam.experiments.commands.explore import Explore
from chainslam.experiments.usage import UsageError
from chainslam.sim.robots import ROBOTS
from chainslam.slam.robot import RobotSpec


def test_the_papers_robot_is_the_default():
    assert trial_of(robot_of("paper")) == trial_of()
    assert robot_of(None) == {}


def test_the_bundled_robots_are_there_by_name_and_as_files():
    assert set(ROBOTS) == {"paper", "turtlebot", "front-scanner"}
    for name, path in ROBOTS.items():
        assert robot_of(name) == robot_of(str(path))
    turtlebot, front = (trial_of(robot_of(name)).robot for name in ("turtlebot", "front-scanner"))
    assert turtlebot.radius_m == pytest.approx(np.hypot(0.1, 0.089))
    assert (turtlebot.lidar.beams, turtlebot.scanner.x_m) == (360, -0.032)
    assert turtlebot.turn_rad == pytest.approx(np.deg2rad(15))
    assert (front.lidar.beams, front.scanner.x_m) == (1081, 0.12)
    assert front.lidar.fov_rad == pytest.approx(1.5 * np.pi)


def test_an_option_wins_over_set_that_over_config_that_over_the_robot(tmp_path):
    mine, config = tmp_path / "mine.yaml", tmp_path / "c.json"
    mine.write_text("radius_m: 0.3\nstep_m: 0.1\nturn_deg: 5\nlidar: {beams: 541}\n")
    config.write_text(json.dumps({"robot": {"step_m": 0.12, "turn_rad": 0.2}}))
    robot = Explore(world="hall", robot=str(mine), config=config, set=("robot.turn_rad=0.3",)).trial.robot
    assert (robot.radius_m, robot.step_m, robot.turn_rad, robot.lidar.beams) == (0.3, 0.12, 0.3, 541)
    campaign = Compare(tmp_path, "smoke", robot=str(mine), set=("robot.step_m=0.05",)).campaign
    assert dict(campaign.settings)["robot.step_m"] == 0.05
    assert dict(campaign.settings)["robot.radius_m"] == 0.3


BAD = {
    "no such name": (None, "did you mean turtlebot"),
    "no YAML": (b"radius_m: [", "a robot's YAML"),
    "a list": (b"- 1", "a robot's YAML"),
    "an unknown key": (b"radus_m: 0.2", "radus_m"),
    "no number": (b"radius_m: wide", "a number"),
    "a negative body": (b"radius_m: -1", "from 0.001"),
    "a fraction of a beam": (b"lidar: {beams: 1.5}", "a whole number"),
    "an outline of two corners": (b"outline_m: [[1, 2], [2, 3]]", "three corners"),
    "an outline of words": (b"outline_m: round", "three corners"),
    "both": (b"outline_m: [[1, 2], [2, 3], [0, 1]]\nradius_m: 1", "leave one of them out"),
    "an alias": (b"radius_m: &a 1\nstep_m: *a", "alias"),
    "bytes": (b"\xff\xfe\x00", "YAML"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_robot_is_told_in_one_line(case, capsys, tmp_path):
    content, words = BAD[case]
    path = tmp_path / "mine.yaml"
    if content is not None:
        path.write_bytes(content)
    name = "turtlebt" if content is None else str(path)
    for command in (["explore", "hall"], ["compare", "--preset", "smoke"]):
        assert main([*command, "--robot", name, "--out", str(tmp_path / "run")]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert words in err
    assert not (tmp_path / "run").exists()


def test_a_run_with_another_robot_is_replayed_with_what_another_states(tmp_path, capsys):
    run = tmp_path / "run"
    assert main(["explore", "paper-fig4", "--robot", "turtlebot", "--max-steps", "3", "--out", str(run)]) == 0
    assert read_trial(run / "config.json").robot == trial_of(robot_of("turtlebot")).robot
    words = ["replay", str(run / "log.npz"), "--robot", "front-scanner", "--out", str(tmp_path / "again")]
    assert main(words) == 0
    replayed = read_trial(tmp_path / "again" / "config.json").robot
    assert replayed.spec == trial_of(robot_of("front-scanner")).robot.spec
    assert replayed.lidar == trial_of(robot_of("turtlebot")).robot.lidar
    assert set(stated(robot_of("turtlebot"))["robot"]) <= {each.name for each in fields(RobotSpec)}
    assert main(["explore", "--resume", str(run), "--robot", "paper"]) == 2
    assert "found robot" in capsys.readouterr().err


def test_nobody_states_a_body_for_one_planner_alone():
    with pytest.raises(UsageError, match="unknown key"):
        parse_setting("mission.explorer.following.paths.robot.radius_m=0.3")
