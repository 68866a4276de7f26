"""Who chooses where the robot goes: the explorer, those that it is wrapped in, or a passenger of a recorded robot."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import networkx as nx

from slam.map.chains import Chain
from slam.robot import MotionCommand

from ..following.wall_following import Surroundings
from ..goal import Goal, LeftPlace, SetAside
from ..outcome import Outcome


@runtime_checkable
class Decider(Protocol):
    """Who chooses where to go: the explorer, or a passenger of a recorded robot."""

    @property
    def set_aside(self) -> dict[tuple[int, int], SetAside]:
        """The ends that exploration gave up, by (wall id, side)."""
        ...

    @property
    def goal(self) -> Goal | None:
        """The open end or the place that the robot is about."""
        ...

    @property
    def walls_to_follow(self) -> tuple[int, ...]:
        """The walls along which the goal is approached."""
        ...

    @property
    def needs_floor(self) -> bool:
        """Whether it plans paths; nobody else reads the free space."""
        ...

    @property
    def still_open(self) -> tuple[SetAside, ...]:
        """The ends that were set aside and are open still."""
        ...

    @property
    def left_places(self) -> tuple[LeftPlace, ...]:
        """The borders of unseen floor that were to be visited, and what was in the way."""
        ...

    @property
    def doing(self) -> str:
        """What the robot is about, in words."""
        ...

    @property
    def outcome(self) -> Outcome:
        """Why there is nothing left to do."""
        ...

    @property
    def closing_words(self) -> str:
        """The same in words."""
        ...

    def command(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> MotionCommand | None:
        """Return the next step, or None at the end."""
        ...

    def interrupt(self, around: Surroundings) -> None:
        """Take note that the robot was led away from its errand, by something that stands in its way."""
        ...

    def start_over(self) -> None:
        """Forget what was given up: the floor is drawn anew, and another one."""
        ...
