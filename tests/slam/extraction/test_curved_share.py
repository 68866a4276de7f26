"""Worlds that are mostly curved are told from those of straight walls, by their first scans."""

import numpy as np
import pytest
import shapely
from shapely.geometry.polygon import orient

from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.sim.worlds import World, load
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.curved_share import SCANS, curved_beams, few_straight, returns_of_scan
from chainslam.slam.extraction.extract import extract
from chainslam.slam.robot import MotionCommand


def said(world, beams):
    """What is said of a world after its first scans, on a turn to the left."""
    lidar = LidarConfig(beams=beams, range_max_m=4.0 if beams == 180 else 10.0)
    robot, curved, returns = SimulatedRobot(world, 1, config=RobotConfig(lidar=lidar)), 0, 0
    for _ in range(SCANS):
        scan = robot.sense()
        curved += curved_beams(scan, extract(scan, ExtractionConfig()))
        returns += returns_of_scan(scan)
        robot.drive(MotionCommand(0.1, 0.1))
    return few_straight(curved, returns)


def forest():
    grove = shapely.box(-6, -6, 6, 6)
    for x in range(-5, 6, 2):
        for y in range(-5, 6, 2):
            grove = grove.difference(shapely.Point(x, y).buffer(0.35))
    return grove


@pytest.mark.parametrize("beams", [180, 541])
@pytest.mark.parametrize("room", [shapely.Point(0, 0).buffer(1.5), shapely.Point(0, 0).buffer(3.0), forest()])
def test_round_rooms_and_pillars_are_told(room, beams):
    world = World("curved", orient(room), np.zeros(3), {})
    assert said(world, beams).startswith("few straight walls: ")


@pytest.mark.parametrize("beams", [180, 541])
@pytest.mark.parametrize("name", ["rooms", "hall", "paper-fig5", "paper-fig9"])
def test_nothing_is_said_of_straight_walls(name, beams):
    assert said(load(name), beams) == ""
