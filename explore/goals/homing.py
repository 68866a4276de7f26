"""Back to the start once there is nothing left to explore."""

from __future__ import annotations

from dataclasses import dataclass, replace

import networkx as nx
import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.quantities import Number
from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import RobotSpec, of_robot

from ..following.behaviour import Behaviour
from ..following.surroundings import Surroundings
from ..following.wall_following import FollowingConfig, PlaceErrand
from ..goal import Goal
from ..planning.sight import cells_within
from .decider import Decider, Decision


@dataclass(frozen=True)
class HomingConfig:
    """The drive back to the start."""

    robot: RobotSpec = of_robot()
    rounds: Number = 5
    """How often the robot drives home and explores what came into sight on the way before it ends."""

    @property
    def home_m(self) -> float:
        """The robot is at its start again within this distance of it: one radius of the body."""
        return self.robot.radius_m

    @property
    def aim_m(self) -> float:
        """What it drives to: the free places this near to the start, all well within `home_m`."""
        return 0.5 * self.robot.radius_m


class Homing:
    """An explorer that ends where it started; everything else is left to the explorer itself."""

    def __init__(
        self, explorer: Decider, start_world: Float[np.ndarray, 2], config: HomingConfig, following: FollowingConfig
    ) -> None:
        self._explorer, self._start, self._config, self._following = explorer, start_world, config, following
        self._way: PlaceErrand | None = None
        self._rounds = 0
        self._explored = Decision(None, "")

    def decide(self, around: Surroundings, chains: tuple[Chain, ...], graph: nx.DiGraph[int]) -> Decision:
        """Return what to do next: explore, then drive home; at the end, whether the robot is at its start again."""
        if self._way is None:
            self._explored = self._explorer.decide(around, chains, graph)
            if self._explored.command is not None:
                return self._explored
            if self._is_home(around) or self._rounds >= self._config.rounds:
                home = self._is_home(around)
                return self._end("" if home else f"the start was not reached in {self._config.rounds} rounds")
            self._rounds += 1
            places = cells_within(around.free_space, self._start, self._config.aim_m)
            self._way = PlaceErrand(around.free_space.points(places), "back to the start", self._following)
        command = self._way.command(around)
        if command is not None:
            goal = Goal("start", None, None, self._start, "nothing is left to explore")
            return replace(
                self._explored, command=command, words=self._way.doing, goal=goal, walls_to_follow=(), outcome=None,
                behaviour=Behaviour.HOME,
            )  # fmt: skip
        trouble, self._way = self._way.trouble, None
        if not self._is_home(around):
            return self._end(f"the start cannot be reached: {trouble or 'no way leads there'}")
        # The way home may have shown something new.
        return self.decide(around, chains, graph)

    def _end(self, trouble: str) -> Decision:
        return replace(self._explored, words=f"{self._explored.words}; {trouble or 'back at the start'}")

    def interrupt(self, around: Surroundings) -> None:
        """Look for another way from here."""
        if self._way is not None:
            self._way.interrupt(around)
        self._explorer.interrupt(around)

    def start_over(self) -> None:
        """Forget what was given up, the way home included."""
        self._way = None
        self._explorer.start_over()

    def _is_home(self, around: Surroundings) -> bool:
        return float(np.hypot(*(around.pose_world[:2] - self._start))) <= self._config.home_m
