"""A mission begins with turns on the spot."""

import networkx as nx
import numpy as np

from chainslam.explore.following.driving_config import DrivingConfig
from chainslam.explore.goals.decider import Decision
from chainslam.explore.goals.explorer import Explorer
from chainslam.explore.goals.first_turns import FIRST_TURNS, FirstTurns
from chainslam.slam.robot import MotionCommand
from tests.explore.goals.scripted import around_of

ON = Decision(MotionCommand(0.1, 0.0), "on")


class Inner(Explorer):
    def __init__(self):
        self.asked, self.told = 0, []

    def decide(self, around, chains, graph):
        self.asked += 1
        return ON

    def watch(self, around):
        self.told.append("watch")

    def interrupt(self, around):
        self.told.append("interrupt")

    def start_over(self):
        self.told.append("start over")


def test_the_robot_turns_before_anybody_is_asked_and_never_again(scene):
    inner = Inner()
    first, around = FirstTurns(inner, DrivingConfig()), around_of(scene)
    decisions = [first.decide(around, (), nx.DiGraph()) for _ in range(FIRST_TURNS)]
    assert inner.asked == 0
    assert all(each.command.forward_m == 0.0 and each.words for each in decisions)
    assert np.all([each.command.turn_rad == DrivingConfig().robot.turn_rad for each in decisions])
    first.interrupt(around)
    first.start_over()
    assert inner.told == ["watch"] * FIRST_TURNS + ["interrupt", "start over"]
    assert first.decide(around, (), nx.DiGraph()) is ON
    assert inner.asked == 1
