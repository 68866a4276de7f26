"""What a robot does while its scans fit nowhere in the map: it turns on the spot, and gives up after a turn.

Where a scan fits elsewhere it drives on, for another one to say the same. It gives up at once where the scans say what
is wrong with the robot itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import networkx as nx
import numpy as np

from chainslam.slam.geometry.quantities import Factor
from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import MotionCommand, Odometry, RobotSpec, of_robot

from ..floor.accumulated_returns import returns
from ..following.behaviour import Behaviour
from ..following.driving import keeps_clear, spin
from ..following.driving_config import DrivingConfig
from ..following.surroundings import Surroundings
from ..goal import GivenUp
from ..outcome import Outcome
from .decider import Decision, Driver


@dataclass(frozen=True)
class LostConfig:
    """How long a lost robot searches for its place."""

    robot: RobotSpec = of_robot()
    turns: Factor = 1.1
    """Number of full turns on the spot after which a robot that finds no place in the map gives up."""

    @property
    def steps(self) -> int:
        """How many steps they take."""
        return int(np.ceil(self.turns * 2.0 * np.pi / self.robot.turn_rad))


class Lost:
    """Leaves all to another driver but the steps at which the robot does not know where it is."""

    def __init__(self, inner: Driver, config: LostConfig, driving: DrivingConfig) -> None:
        self._inner, self._config, self._driving = inner, config, driving
        self._step, self._since = -1, -1
        self._given_up = GivenUp()

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of what the odometry reported of a command."""
        self._inner.moved(command, odometry)

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return what to do next: what the inner driver says, or a turn on the spot, or at last nothing more."""
        self._step += 1
        if around.fault:
            words = f"at step {self._step}: {around.fault}"
            return Decision(None, words, given_up=self._given_up, outcome=Outcome.FAILED)
        if not around.is_lost:
            self._since = -1
            decision = self._inner.decide(around, chains, graph)
            self._given_up = decision.given_up
            return decision
        if self._since < 0:
            self._since = self._step
        if self._step - self._since >= self._config.steps:
            words = f"lost at step {self._since}: its scans contradict the map, and no place in it fits"
            return Decision(None, words, given_up=self._given_up, outcome=Outcome.FAILED)
        if around.is_leap_pending:
            words = f"lost since step {self._since}: drives on to see whether it is where a scan has shown it"
            return Decision(self._onward(around), words, given_up=self._given_up, behaviour=Behaviour.LOST)
        words = f"lost since step {self._since}: turns to find its place"
        return Decision(spin(around, 1.0, self._driving), words, given_up=self._given_up, behaviour=Behaviour.LOST)

    def _onward(self, around: Surroundings) -> MotionCommand:
        """Return the straightest step ahead that the scan alone shows free, or a turn."""
        robot = self._config.robot
        points = returns(around.scan, robot.scanner)
        for turn in (0.0, robot.turn_rad, -robot.turn_rad):
            command = MotionCommand(robot.step_m, turn)
            if keeps_clear(command, points, self._driving):
                return command
        return spin(around, 1.0, self._driving)
