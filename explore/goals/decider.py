"""What the robot does next and why, as one value, and who decides it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import networkx as nx

from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import MotionCommand, Odometry

from ..following.behaviour import Behaviour
from ..following.surroundings import Surroundings
from ..goal import GivenUp, Goal
from ..outcome import Outcome


@dataclass(frozen=True)
class Decision:
    """What the robot does next, and why."""

    command: MotionCommand | None
    """None once there is nothing left to do; then the outcome says why."""
    words: str
    """What the robot is about and why; at the end, why there is nothing left to do."""
    goal: Goal | None = None
    """The open end or the place that it is about."""
    walls_to_follow: tuple[int, ...] = ()
    """The walls along which the goal is approached."""
    given_up: GivenUp = field(default_factory=GivenUp)
    behaviour: Behaviour = Behaviour.LOOK
    """What the robot is doing, as one word."""
    outcome: Outcome | None = None
    """Why the mission is over, at its last step, else None."""


@runtime_checkable
class Driver(Protocol):
    """Who drives: the robot itself, or whoever drove when a recording was made."""

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return what to do after one more scan."""
        ...

    def moved(self, command: MotionCommand, odometry: Odometry) -> None:
        """Take note of what the odometry reported of a command."""
        ...


@runtime_checkable
class Decider(Protocol):
    """Who chooses where to go: the explorer, or what it is wrapped in."""

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return what to do after one more scan."""
        ...

    def interrupt(self, around: Surroundings) -> None:
        """Take note that the robot was led away from its errand, by something that stands in its way."""
        ...

    def start_over(self) -> None:
        """Forget what was given up: the floor is drawn anew, and another one."""
        ...
