"""A robot with a fault that nothing can mend fails within a hundred steps, says why, and touches nothing before."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import listing
from chainslam.slam.odometry.diagnosis import Diagnosis

FROM = 30
FAULTS = {
    "left and right are swapped": FaultsConfig(mirrored=True),
    "turned by about": FaultsConfig(scanner_turned_rad=0.5 * np.pi),
    "turned by about -": FaultsConfig(scanner_turned_rad=-2.2),
    "sits about": FaultsConfig(scanner_ahead_m=0.12, scanner_left_m=-0.05),
    "late by 1 step": FaultsConfig(late=1),
    "late by 2 steps": FaultsConfig(late=2),
    "repeats one scan": FaultsConfig(frozen_from=FROM),
    "the robot stands": FaultsConfig(stuck_from=FROM),
}


def summary(world, faults, seed, max_steps=160, beams=360):
    robot = RobotConfig(lidar=LidarConfig(beams=beams), faults=faults)
    return run_trial(TrialConfig(world, "invariant-ekf", seed=seed, max_steps=max_steps, robot=robot)).summary


def fails(words, world, seed, beams=360):
    found = summary(world, FAULTS[words], seed, beams=beams)
    assert found["status"] == "failed", found["reason"]
    assert words in found["reason"]
    begun = FROM if words in ("repeats one scan", "the robot stands") else 0
    assert found["steps"] - begun <= 100
    assert found["collisions"] == 0


@pytest.mark.parametrize("words", ["sits about", "late by 1 step", "repeats one scan"])
def test_a_fault_ends_a_mission_before_anything_is_touched(words):
    fails(words, "rooms", 1)


@pytest.mark.long
@pytest.mark.parametrize("words", FAULTS)
def test_faults_end_missions_in_other_buildings_with_other_seeds_and_scanners(words):
    for world, seed, beams in (
        ("rooms", 1, 360),
        ("rooms", 5, 180),
        ("rooms", 6, 541),
        ("hall", 1, 360),
        ("paper-fig9", 2, 360),
    ):
        fails(words, world, seed, beams)


@pytest.mark.long
@pytest.mark.parametrize("world", listing())
def test_a_sound_robot_is_accused_of_nothing_however_often_it_is_asked(world, monkeypatch):
    """In every bundled building; faults are tried after each scan, not only where the map was rescued."""
    see, said = Diagnosis.see, []

    def asked(self, scan, was_rescued, is_in_doubt):
        said.append(see(self, scan, was_rescued, True))
        return said[-1]

    monkeypatch.setattr(Diagnosis, "see", asked)
    for faults in (FaultsConfig(), replace(FaultsConfig(), bump=0.05, slip=2.0)):
        assert summary(world, faults, 1, 250)["status"] != "failed"
    assert len(said) > 50
    assert not any(said)
