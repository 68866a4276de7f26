"""The closed loop over any robot, as a generator of steps: sense, map, choose, drive."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from slam.mapper import Mapper
from slam.robot import Odometry, Robot

from .floor.accumulated_returns import RecentReturns
from .floor.floor_memory import FloorMemory, FloorMemoryConfig
from .floor.free_space import FreeSpace, FreeSpaceConfig
from .following.wall_following import Surroundings
from .goals.decider import Decider
from .goals.explorer import Explorer, ExplorerConfig
from .goals.homing import Homing
from .goals.replay_driver import Passenger
from .goals.retreat import Retreat
from .outcome import Outcome
from .planning.visibility_graph import VisibilityGraph, followed_wall
from .step import Step
from .strategies import Strategy


@dataclass(frozen=True)
class MissionConfig:
    """All that rules a mission but its mapper; each part's settings stand beside its code."""

    explorer: ExplorerConfig = field(default_factory=ExplorerConfig)
    free_space: FreeSpaceConfig = field(default_factory=FreeSpaceConfig)
    floor_memory: FloorMemoryConfig = field(default_factory=FloorMemoryConfig)
    return_to_start: bool = False
    """Once there is nothing left to explore, drive back to where the mission began."""


def explore_mission(
    robot: Robot, mapper: Mapper, strategy: Strategy, config: MissionConfig = MissionConfig()
) -> Iterator[Step]:
    """Drive `robot` until every chain is closed or no open end can be reached, and yield each step.

    The `mapper` holds the back end, whose pose is where the robot believes to start. `limited` ends a mission early.
    """
    start = mapper.backend.belief.pose_world[:2].copy()
    explorer = Explorer(strategy, start, config.explorer)
    decider = Homing(explorer, start, config.explorer.following) if config.return_to_start else explorer
    return _mission(robot, mapper, decider, config)


def ride_mission(robot: Robot, mapper: Mapper, scans: int, config: MissionConfig = MissionConfig()) -> Iterator[Step]:
    """Map what a recorded robot sensed in `scans` scans, wherever it was driven, and yield each step."""
    return _mission(robot, mapper, Passenger(scans), config)


def _mission(robot: Robot, mapper: Mapper, inner: Decider, config: MissionConfig) -> Iterator[Step]:
    free_space, graph, recent = FreeSpace(config.free_space), VisibilityGraph(), RecentReturns()
    floor = FloorMemory(free_space, config.floor_memory)
    decider = Retreat(inner, floor, config.explorer.following)
    odometry = Odometry(np.zeros(3), np.zeros((3, 3)))
    path_length, index = 0.0, 0
    while True:
        began = time.perf_counter()
        scan = robot.sense()
        update = mapper.step(scan, decider.set_aside.keys())
        if decider.needs_floor:
            floor.see(update.map, scan)
        decides = time.thread_time()
        seen = np.unique(update.walls_of_segments[update.walls_of_segments >= 0]).tolist()
        graph.observe(update.map, update.chains, followed_wall(update.map), seen)
        around = Surroundings(update.map, free_space, scan, recent.points_robot)
        command = decider.command(around, update.chains, graph.graph)
        outcome, reason = None, decider.doing
        if command is None:
            outcome, reason = decider.outcome, decider.closing_words
            if outcome is Outcome.ALL_CLOSED and not update.chains:
                outcome, reason = Outcome.NO_WALL, "no wall was found"
        decided = time.thread_time() - decides
        yield Step(
            index, scan.time_s, odometry, scan, update.segments, update.matches, update.walls_of_segments,
            update.map, update.chains, free_space, graph.graph, decider.goal, decider.walls_to_follow,
            decider.still_open, command, path_length, time.perf_counter() - began, decided,
            outcome, reason, update.merged, decider.left_places,
        )  # fmt: skip
        if command is None:
            return
        odometry = robot.drive(command)
        mapper.predict(odometry)
        floor.move(odometry)
        decider.moved(command, odometry)
        recent.see(scan)
        recent.move(odometry)
        path_length += float(np.hypot(odometry.motion[0], odometry.motion[1]))
        index += 1
