"""A driver that waits while earlier sessions are played, and a mission in which the robot was carried."""

import numpy as np
import pytest

from chainslam.explore.goals.decider import Decision
from chainslam.explore.goals.later_session import LaterSession
from chainslam.explore.mission import ride_mission
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.sim.logs.recorded_robot import RecordedRobot, Recording
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import MotionCommand, Odometry

pytestmark = pytest.mark.usefixtures("_unchecked")
ON = MotionCommand(0.1, 0.0)
MOVED = Odometry(np.zeros(3), np.zeros((3, 3)))


class Explorer:
    """Counts what it is asked and told."""

    def __init__(self):
        self.decided, self.told = 0, 0

    def decide(self, around, chains, graph):
        self.decided += 1
        return Decision(ON, "exploring")

    def moved(self, command, odometry):
        self.told += 1


def test_exploration_begins_at_the_scan_after_the_recorded_ones_with_an_explorer_made_there():
    made = []

    def explorer():
        made.append(Explorer())
        return made[-1]

    driver = LaterSession(explorer, 3)
    for k in range(3):
        assert driver.decide(None, (), None).command == MotionCommand(0.0, 0.0)
        driver.moved(ON, MOVED)
        assert not made, k
    for k in range(1, 3):
        assert driver.decide(None, (), None).command is ON
        driver.moved(ON, MOVED)
        assert [(each.decided, each.told) for each in made] == [(k, k)]


def test_where_the_robot_was_carried_is_no_path():
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
    finder = RangeFinder(np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), LidarConfig())
    poses = np.array([[1.0, 1.0, 0.0], [1.1, 1.0, 0.0], [2.1, 1.0, 0.0], [2.3, 1.0, 0.0]])
    motions, count = np.diff(poses, axis=0, prepend=poses[:1]), len(poses)
    recording = Recording(
        np.arange(float(count)), finder.bearings_rad, np.array([finder.cast(pose)[0] for pose in poses]),
        np.full(len(finder.bearings_rad), 0.01), finder.config.range_max_m, motions,
        np.tile(1e-4 * np.eye(3), (count, 1, 1)), carried=np.array([False, False, True, False]),
    )  # fmt: skip
    mapper = Mapper(BACKENDS["full-ekf"].make(poses[0], 1e-6 * np.eye(3)))
    steps = list(ride_mission(RecordedRobot(recording), mapper, count))
    assert [each.path_length_m for each in steps] == pytest.approx([0.0, 0.1, 0.1, 0.3])
    assert [each.odometry.carried for each in steps] == [False, False, True, False]
