"""What a robot states of itself: one body and one step, from which every setting that stands for them follows."""

from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.explore.mission import MissionConfig
from chainslam.sim.drive import clamp
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.robot import RobotConfig
from chainslam.slam.robot import (
    STATED,
    MotionCommand,
    RobotError,
    RobotSpec,
    ScannerSpec,
    WheelSpec,
    fitted,
    of_outline,
)

OF_THE_PAPER = {
    "explorer.near_m": 0.3,
    "explorer.patience_steps": 400,
    "explorer.following.paths.squeeze_m": 0.2,
    "explorer.following.paths.standoff_m": 0.35,
    "explorer.following.paths.escape_m": 0.3,
    "explorer.following.driving.radius_m": 0.2,
    "explorer.following.viewpoints.standoff_m": 0.35,
    "explorer.following.viewpoints.close_m": 0.25,
    "free_space.body_m": 0.2,
    "free_space.clearance_limit_m": 1.0,
    "floor_memory.last_scans": 100,
    "homing.home_m": 0.2,
    "homing.aim_m": 0.1,
    "retreat.touched_back_m": 0.1,
}
"""Exactly what these were when each was a number of its own."""


def value_of(settings, key):
    for name in key.split("."):
        settings = getattr(settings, name)
    return settings


def groups(settings):
    """Yield a group of settings and all within."""
    yield settings
    for each in fields(settings):
        value = getattr(settings, each.name)
        if is_dataclass(value) and not each.metadata.get(STATED):
            yield from groups(value)


@pytest.mark.parametrize("key", OF_THE_PAPER)
def test_what_follows_from_the_papers_robot_is_to_the_last_bit_what_it_was(key):
    assert value_of(TrialConfig("").mission, key) == OF_THE_PAPER[key]


@pytest.mark.parametrize("key", [key for key, value in OF_THE_PAPER.items() if type(value) is float])
def test_every_length_grows_with_the_body_or_the_step(key):
    mission = TrialConfig("", robot=RobotConfig(radius_m=0.3, step_m=0.04)).mission
    assert value_of(mission, key) != OF_THE_PAPER[key]
    wider = 0.05 if key.endswith((".touched_m", "aim_m", "back_m")) else 0.1
    if not key.endswith(".step_m"):
        assert value_of(mission, key) == pytest.approx(OF_THE_PAPER[key] + wider)


def test_what_a_robot_states_reaches_every_group_and_nothing_else_of_it_does():
    stated = {"radius_m": 0.3, "step_m": 0.1, "scanner": ScannerSpec(0.1), "wheels": WheelSpec(0.3)}
    trial = TrialConfig("", robot=RobotConfig(**stated, faults=FaultsConfig(dropout=0.1)))
    reached = [group.robot for group in groups(trial.mission) if hasattr(group, "robot")]
    assert len(reached) >= 12
    for robot in reached:
        assert type(robot) is RobotSpec
        assert robot == RobotSpec(**stated)
    # Also where the robot is exchanged later.
    assert replace(trial, robot=RobotConfig()).mission == TrialConfig("").mission
    assert fitted(MissionConfig(), RobotSpec()) == MissionConfig()


def test_patience_in_metres_is_one_in_steps_for_short_steps_and_for_slow_turns():
    assert RobotSpec(step_m=0.05).steps_of(9.0) == 180
    assert RobotSpec(turn_rad=float(np.deg2rad(2.5))).steps_of(9.0) == 240
    assert RobotSpec(step_m=0.3, turn_rad=1.0).steps_of(9.0) == 30


def test_an_outline_is_held_by_a_disc_about_the_axle():
    assert of_outline(np.array([[0.3, 0.4], [-0.1, 0.4], [-0.1, -0.4], [0.3, -0.4]])) == pytest.approx(0.5)


BAD = [
    {"radius_m": 0.0},
    {"radius_m": float("inf")},
    {"step_m": -0.1},
    {"turn_rad": 0.0},
    {"scanner": ScannerSpec(x_m=float("nan"))},
    {"wheels": WheelSpec(base_m=0.0)},
    {"wheels": WheelSpec(slip=-0.1)},
]


@pytest.mark.parametrize("stated", BAD)
def test_a_robot_that_cannot_be_is_told_in_one_line(stated):
    with pytest.raises(RobotError, match=r"^expected .*, found .*: correct it$"):
        RobotSpec(**stated)


def test_a_robot_that_cannot_reverse_turns_instead():
    command = clamp(MotionCommand(-0.3, 0.1), RobotSpec(can_reverse=False))
    assert (command.forward_m, command.turn_rad) == (0.0, 0.1)
    assert clamp(MotionCommand(-0.3, 0.1), RobotSpec()).forward_m == -0.15
