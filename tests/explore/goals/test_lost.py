"""A robot without a place turns on the spot, and gives up after a turn; one with a place is left alone."""

from dataclasses import dataclass, field

import networkx as nx
import numpy as np
import pytest

from chainslam.explore.following.driving_config import DrivingConfig
from chainslam.explore.goals.decider import Decision
from chainslam.explore.goals.lost import Lost, LostConfig
from chainslam.explore.goals.replay_driver import ReplayDriver
from chainslam.explore.outcome import Outcome
from chainslam.slam.robot import MotionCommand, Scan

pytestmark = pytest.mark.usefixtures("_unchecked")
"""The surroundings are stood in for."""


BEARINGS = np.linspace(-np.pi, np.pi, 90, endpoint=False)


@dataclass
class Around:
    is_lost: bool
    fault: str = ""
    is_leap_pending: bool = False
    scan: Scan = field(default_factory=lambda: Scan(BEARINGS, np.full(90, 2.0), 0.01, 4.0, 0.0))
    recent_robot: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    touched_robot: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))


class Inner:
    """Counts how often it is asked."""

    asked = moved_by = 0

    def decide(self, around, chains, graph):
        self.asked += 1
        return Decision(MotionCommand(0.1, 0.0), "drives")

    def moved(self, command, odometry):
        self.moved_by += 1


def drive(lost):
    inner = Inner()
    driver = Lost(inner, LostConfig(turns=3 * 10.0 / 360.0), DrivingConfig())
    return inner, [driver.decide(Around(is_lost), (), nx.DiGraph()) for is_lost in lost]


def test_a_robot_that_knows_its_place_is_left_alone():
    inner, decisions = drive([False] * 5)
    assert inner.asked == 5
    assert {decision.words for decision in decisions} == {"drives"}


def test_a_lost_robot_turns_on_the_spot_and_goes_on_once_it_is_found():
    inner, decisions = drive([False, True, True, False, True])
    assert inner.asked == 2
    turning = [decisions[k] for k in (1, 2, 4)]
    assert all(decision.command.forward_m == 0.0 and decision.command.turn_rad > 0.0 for decision in turning)
    assert "lost since step 1" in decisions[2].words
    assert "lost since step 4" in decisions[4].words


def test_a_robot_that_stays_lost_fails_and_says_since_when():
    _, decisions = drive([False, False, True, True, True, True])
    last = decisions[-1]
    assert last.command is None
    assert last.outcome is Outcome.FAILED
    assert last.words.startswith("lost at step 2")
    assert [decision.command is None for decision in decisions[:-1]] == [False] * 5


@pytest.mark.parametrize(
    ("lost", "outcome", "words"),
    [
        ([False, True, False, False], Outcome.RECORDING_ENDED, "the recording has ended"),
        ([False, False, False, True], Outcome.RECORDING_ENDED, "lost since step 3"),
        ([False, True, True, True], Outcome.FAILED, "lost at step 1"),
    ],
)
def test_a_recording_that_ends_while_the_robot_is_lost_says_so(lost, outcome, words):
    driver = ReplayDriver(len(lost), LostConfig(turns=3 * 10.0 / 360.0))
    decisions = [driver.decide(Around(is_lost), (), nx.DiGraph()) for is_lost in lost]
    assert all(decision.outcome is None for decision in decisions[:-1])
    assert decisions[-1].outcome is outcome
    assert words in decisions[-1].words


def test_a_robot_with_a_fault_gives_up_at_once_and_says_why():
    inner = Inner()
    driver = Lost(inner, LostConfig(), DrivingConfig())
    for fault in ("", "the scans are late"):
        decision = driver.decide(Around(True, fault), (), nx.DiGraph())
    assert decision.command is None
    assert decision.outcome is Outcome.FAILED
    assert decision.words == "at step 1: the scans are late"


@pytest.mark.parametrize(("walls_m", "forward"), [(2.0, True), (0.25, False)])
def test_where_a_scan_fits_elsewhere_the_robot_drives_on_as_far_as_the_scan_shows_free(walls_m, forward):
    scan = Scan(BEARINGS, np.full(90, walls_m), 0.01, 4.0, 0.0)
    decision = Lost(Inner(), LostConfig(), DrivingConfig()).decide(Around(True, "", True, scan), (), nx.DiGraph())
    assert (decision.command.forward_m > 0.0) == forward
    assert forward or decision.command.turn_rad > 0.0
    assert decision.behaviour == "lost"
