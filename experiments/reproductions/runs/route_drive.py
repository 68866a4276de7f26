"""A robot that explores and then drives between two walls along a route planned on the visibility graph."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby

import numpy as np

from chainslam.explore.planning.visibility_graph import followed_wall
from chainslam.explore.planning.wall_routes import sequence
from chainslam.explore.step import Step
from chainslam.explore.strategies import Choice, Place, Situation, Strategy
from chainslam.explore.survey.viewpoints import lane
from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.stochastic_map import StochasticMap

from ...scenario import Scenario, TrialConfig
from ...scoring.maps.coverage import alignment
from ...trial import TrialResult, default_mission, run_trial

ARRIVED_M = 1.0
NEAR_M = 0.5
"""A mapped wall corresponds to that of the plan if their middles are this near."""
Named = Callable[[StochasticMap], Mapping[str, int]]
"""A function from a map to the ids of the walls that have names in the plan."""


@dataclass
class AlongRoute:
    """A strategy that wraps another one, and continues with a route of walls when nothing is left to explore."""

    explores: Strategy
    named: Named
    ends: tuple[str, str]
    """Names of the first and the last wall."""
    plan: tuple[int, ...] = ()
    """Ids of the planned walls."""
    names: dict[int, str] = field(default_factory=dict)
    """Names of the walls at that time, by their ids."""
    _done: int = 0
    """Number of visited walls."""

    def choose(self, situation: Situation) -> Choice | None:
        """Return where to explore; then the first wall, then each planned wall in turn; then None."""
        if situation.open_ends:
            return self.explores.choose(situation)
        if self._done == 0:
            ids = self.named(situation.map)
            if not set(self.ends) <= ids.keys():
                return None
            self.plan, self._done = (ids[self.ends[0]], ids[self.ends[1]]), 1
            return self._to(self.plan[0], situation, "to begin with")
        if self._done == 1:
            self.names = {wall: name for name, wall in self.named(situation.map).items()}
            start, goal = self.plan[0], self.plan[-1]
            self.plan = sequence(situation.graph, (start,), goal) or (goal,)
        if self._done >= len(self.plan):
            return None
        self._done += 1
        words = f"number {self._done} of {len(self.plan)} walls that lead to wall {self.plan[-1]}"
        return self._to(self.plan[self._done - 1], situation, words)

    @property
    def taken(self) -> int:
        """Number of walls of the plan that are visited or under way; 0 during exploration."""
        return self._done

    def _to(self, wall: int, situation: Situation, why: str) -> Choice | None:
        if wall not in situation.map.ids:
            return None
        beside = lane(wall, situation.map, situation.following.viewpoints.standoff_m)
        return Choice(Place(beside, f"wall {wall} is followed", "wall"), why)


@dataclass(frozen=True)
class RouteDrive:
    """An exploration followed by a route of walls."""

    made: TrialResult
    names: dict[int, str]
    """Ids of the named walls, in the last map and in that of the plan."""
    plan: tuple[int, ...]
    """Ids of the planned walls, including the first and the goal; empty if one of them is missing."""
    steps: tuple[int, int, int]
    """Steps at which exploration ended, the first wall was reached, and the last one."""
    followed: tuple[int, ...]
    """Ids of the nearest walls along the path, in order; of two walls at a corner, the planned one."""
    has_arrived: bool
    """Whether the robot ends within `ARRIVED_M` of the goal."""


def drive_route(config: TrialConfig, ends: tuple[str, str]) -> RouteDrive:
    """Explore a world whose walls are named, then drive from one wall to another; raises UsageError for bad names."""
    found: list[AlongRoute] = []
    taken: list[int] = []
    followed: list[int | None] = []

    def watch(step: Step) -> None:
        taken.append(found[0].taken)
        if taken[-1] > 1:
            followed.append(followed_wall(step.map, rather=found[0].plan))

    def mission(scenario: Scenario) -> Iterator[Step]:
        assert scenario.strategy is not None, "expected a strategy to explore by"
        found.append(AlongRoute(scenario.strategy, _named(scenario), ends))
        return default_mission(replace(scenario, strategy=found[0]))

    made = run_trial(config, watch, mission=mission)
    assert made.last is not None
    names = found[0].names | {wall: name for name, wall in _named(made.scenario)(made.last.map).items()}
    along = tuple(wall for wall, _ in groupby(followed) if wall is not None)
    walls = made.last.map
    goals = [row for row, wall in enumerate(walls.ids.tolist()) if found[0].plan and names.get(wall) == ends[1]]
    has_arrived = any(walls.distances_m[row] <= ARRIVED_M for row in goals)
    explored, began = (sum(count <= most for count in taken) for most in (0, 1))
    end = len(taken) - 1
    return RouteDrive(made, names, found[0].plan, (min(explored, end), min(began, end), end), along, has_arrived)


def _named(scenario: Scenario) -> Named:
    """Return a function that names the walls of a map by the labels of the plan at their middles."""
    labels = scenario.world.labels
    to_true = alignment(scenario.start_estimate, scenario.world.start)

    def named(walls: StochasticMap) -> dict[str, int]:
        rows = np.flatnonzero(~walls.tentative)
        middles = to_world(walls.ends_world[rows].mean(axis=1), to_true)
        metres = {name: np.hypot(*(middles - np.array(at)).T) for name, at in labels.items()}
        nearest = {name: int(np.argmin(gaps)) for name, gaps in metres.items()} if len(rows) else {}
        return {name: int(walls.ids[rows[k]]) for name, k in nearest.items() if metres[name][k] <= NEAR_M}

    return named
