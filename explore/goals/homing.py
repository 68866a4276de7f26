"""Back to the start once there is nothing left to explore."""

from __future__ import annotations

import networkx as nx
import numpy as np
from jaxtyping import Float

from slam.map.chains import Chain
from slam.robot import MotionCommand

from ..following.wall_following import FollowingConfig, PlaceErrand, Surroundings
from ..goal import Goal, LeftPlace, SetAside
from ..outcome import Outcome
from ..planning.paths import cells_within
from .explorer import Explorer

HOME_M = 0.2
"""The robot is at its start again within this distance of it."""
AIM_M = 0.1
"""What it drives to: the free places this near to the start."""
ROUNDS = 5
"""What the way home shows is explored too, and the robot goes home again, up to this often."""


class Homing:
    """An explorer that ends where it started; everything else is left to the explorer itself."""

    def __init__(self, explorer: Explorer, start_world: Float[np.ndarray, 2], config: FollowingConfig) -> None:
        self._explorer, self._start, self._config = explorer, start_world, config
        self._way: PlaceErrand | None = None
        self._rounds = 0
        self._trouble = ""
        self.needs_floor = True

    @property
    def set_aside(self) -> dict[tuple[int, int], SetAside]:
        """The ends that exploration gave up."""
        return self._explorer.set_aside

    @property
    def still_open(self) -> tuple[SetAside, ...]:
        """Those of them that are open still."""
        return self._explorer.still_open

    @property
    def left_places(self) -> tuple[LeftPlace, ...]:
        """The borders of unseen floor that were to be visited, and what was in the way."""
        return self._explorer.left_places

    @property
    def goal(self) -> Goal | None:
        """The open end or the place that the robot is about."""
        if self._way is None:
            return self._explorer.goal
        return Goal("start", None, None, self._start, "nothing is left to explore")

    @property
    def walls_to_follow(self) -> tuple[int, ...]:
        """The walls along which the goal is approached; none on the way home."""
        return () if self._way is not None else self._explorer.walls_to_follow

    @property
    def doing(self) -> str:
        """What the robot is about, in words."""
        return self._explorer.doing if self._way is None else self._way.doing

    @property
    def outcome(self) -> Outcome:
        """Why exploration is over."""
        return self._explorer.outcome

    @property
    def closing_words(self) -> str:
        """Why exploration is over, and whether the robot is at its start again."""
        return f"{self._explorer.closing_words}; {self._trouble or 'back at the start'}"

    def command(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> MotionCommand | None:
        """Return the next step, or None when all is explored and the robot is back, or cannot get back."""
        if self._way is None:
            command = self._explorer.command(around, chains, graph)
            if command is not None:
                return command
            if self._is_home(around) or self._rounds >= ROUNDS:
                self._trouble = "" if self._is_home(around) else f"the start was not reached in {ROUNDS} rounds"
                return None
            self._rounds += 1
            places = cells_within(around.free_space, self._start, AIM_M)
            self._way = PlaceErrand(around.free_space.points(places), "back to the start", self._config)
        command = self._way.command(around)
        if command is not None:
            return command
        trouble, self._way = self._way.trouble, None
        if not self._is_home(around):
            self._trouble = f"the start cannot be reached: {trouble or 'no way leads there'}"
            return None
        # The way home may have shown something new.
        return self.command(around, chains, graph)

    def interrupt(self, around: Surroundings) -> None:
        """Look for another way from here."""
        if self._way is not None:
            self._way.interrupt(around)
        self._explorer.interrupt(around)

    def start_over(self) -> None:
        """Forget what was given up, the way home included."""
        self._way, self._trouble = None, ""
        self._explorer.start_over()

    def _is_home(self, around: Surroundings) -> bool:
        return float(np.hypot(*(around.pose_world[:2] - self._start))) <= HOME_M
