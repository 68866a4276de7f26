"""The closed loop over any robot, as a generator of steps: sense, map, choose, drive."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from slam.backend import Backend
from slam.mapper import Mapper, MapperConfig
from slam.robot import Odometry, Robot

from .explorer import Explorer, ExplorerConfig
from .free_space import FreeSpace, FreeSpaceConfig
from .step import Step
from .strategies import Strategy
from .visibility import VisibilityGraph, followed_wall
from .wall_following import Surroundings


@dataclass(frozen=True)
class MissionConfig:
    """All that rules a mission; each part's settings stand beside its code."""

    mapper: MapperConfig = field(default_factory=MapperConfig)
    explorer: ExplorerConfig = field(default_factory=ExplorerConfig)
    free_space: FreeSpaceConfig = field(default_factory=FreeSpaceConfig)
    max_steps: int = 100_000
    """A mission that takes longer ends as `stopped`."""


def explore_mission(
    robot: Robot,
    backend: Backend,
    strategy: Strategy,
    config: MissionConfig = MissionConfig(),
    mapper: Mapper | None = None,
) -> Iterator[Step]:
    """Drive `robot` until every chain is closed or no open end can be reached, and yield each step.

    A `mapper` made elsewhere (with oracles in place of extraction or matching) takes the place of the usual one.
    """
    mapper = mapper or Mapper(backend, config.mapper)
    free_space, graph = FreeSpace(config.free_space), VisibilityGraph()
    explorer = Explorer(strategy, backend.belief.pose_world[:2].copy(), config.explorer)
    odometry = Odometry(np.zeros(3), np.zeros((3, 3)))
    path_length, index = 0.0, 0
    while True:
        began = time.perf_counter()
        scan = robot.sense()
        update = mapper.step(scan, explorer.set_aside.keys())
        pose_world = update.map.belief.pose_world
        free_space.integrate(pose_world, scan)
        seen = np.unique(update.walls_of_segments[update.walls_of_segments >= 0]).tolist()
        graph.observe(update.map, update.chains, followed_wall(update.map), seen)
        around = Surroundings(update.map, free_space, scan)
        ended, command = None, None
        if index + 1 >= config.max_steps:
            ended, reason = "stopped", f"the limit of {config.max_steps} steps"
        else:
            command = explorer.command(around, update.chains, graph.graph)
            reason = explorer.doing
            if command is None:
                ended, reason = "complete", _closing_words(explorer)
        yield Step(
            index, scan.time_s, odometry, scan, update.segments, update.matches, update.walls_of_segments,
            update.map, update.chains, free_space, graph.graph, explorer.goal, explorer.walls_to_follow,
            explorer.still_open, command, path_length, time.perf_counter() - began, ended, reason,
        )  # fmt: skip
        if command is None:
            return
        odometry = robot.drive(command)
        mapper.predict(odometry)
        path_length += float(np.hypot(odometry.motion[0], odometry.motion[1]))
        index += 1


def _closing_words(explorer: Explorer) -> str:
    left = len(explorer.still_open)
    return "every chain is closed" if not left else f"no reachable open end is left; {left} cannot be closed"
