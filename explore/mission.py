"""The closed loop over any robot, as a generator of steps: sense, map, choose, drive."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from chainslam.slam.geometry.compiled import compiling_s
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Robot, RobotSpec, of_robot

from .floor.accumulated_returns import AccumulatedReturns
from .floor.floor_memory import FloorMemory, FloorMemoryConfig
from .floor.free_space import FreeSpace, FreeSpaceConfig
from .floor.lost_returns import LostReturns
from .following.surroundings import Surroundings
from .goal import GivenUp
from .goals.decider import Driver
from .goals.explorer import Explorer
from .goals.explorer_config import ExplorerConfig
from .goals.homing import Homing, HomingConfig
from .goals.later_session import LaterSession
from .goals.lost import Lost, LostConfig
from .goals.replay_driver import ReplayDriver
from .goals.retreat import Retreat, RetreatConfig
from .outcome import Outcome
from .planning.visibility_graph import VisibilityGraph, followed_wall
from .step import Step
from .strategies import Strategy


@dataclass(frozen=True)
class MissionConfig:
    """All that rules a mission but its mapper; each part's settings stand beside its code."""

    robot: RobotSpec = of_robot()
    explorer: ExplorerConfig = field(default_factory=ExplorerConfig)
    free_space: FreeSpaceConfig = field(default_factory=FreeSpaceConfig)
    floor_memory: FloorMemoryConfig = field(default_factory=FloorMemoryConfig)
    retreat: RetreatConfig = field(default_factory=RetreatConfig)
    homing: HomingConfig = field(default_factory=HomingConfig)
    lost: LostConfig = field(default_factory=LostConfig)
    return_to_start: bool = False
    """Drive back to the start once nothing is left to explore."""


def explore_mission(
    robot: Robot, mapper: Mapper, strategy: Strategy, config: MissionConfig = MissionConfig(), recorded: int = 0
) -> Iterator[Step]:
    """Drive `robot` until every chain is closed or no open end can be reached, and yield each step.

    The `mapper` holds the back end, which begins where the scanner is believed to be (`start_of_scanner`). `limited`
    ends a mission early.
    What the robot states of itself stands in the settings: `slam.robot.fitted(MissionConfig(), robot_spec)`; the same
    for the mapper's. Raises ValueError where they are of two robots.
    Where the first `recorded` scans come from earlier sessions, whatever the commands, exploration begins after them.
    """
    if mapper.config.robot != config.robot:
        raise ValueError(
            "expected a mapper and a mission of one robot, found those of two: `fitted` both to what it states"
        )
    floor = FloorMemory(FreeSpace(config.free_space), config.floor_memory)

    def explorer() -> Driver:
        start, following = mapper.belief.pose_world[:2].copy(), config.explorer.following
        explorer = Explorer(strategy, start, config.explorer)
        inner = Homing(explorer, start, config.homing, following) if config.return_to_start else explorer
        return Lost(Retreat(inner, floor, config.retreat, following), config.lost, following.driving)

    driver = LaterSession(explorer, recorded) if recorded else explorer()
    return driven_mission(robot, mapper, driver, floor)


def ride_mission(robot: Robot, mapper: Mapper, scans: int, cut_short: str = "", unread: str = "") -> Iterator[Step]:
    """Map what a recorded robot sensed in `scans` scans, wherever it was driven, and yield each step.

    `cut_short` says in words what ended its drive early, and `unread` why most of its log was not read: such a run has
    failed. Nobody plans, so nobody keeps the free floor.
    """
    return driven_mission(robot, mapper, ReplayDriver(scans, LostConfig(mapper.config.robot), cut_short, unread), None)


def driven_mission(robot: Robot, mapper: Mapper, driver: Driver, floor: FloorMemory | None) -> Iterator[Step]:
    """Map what a robot senses while somebody drives it, and yield each step; without `floor` nobody keeps it."""
    spec = mapper.config.robot
    graph, recent, lost = VisibilityGraph(), AccumulatedReturns(spec), LostReturns(spec.scanner)
    free_space = FreeSpace() if floor is None else floor.free_space
    odometry = Odometry(np.zeros(3), np.zeros((3, 3)))
    given_up = GivenUp()
    path_length, index = 0.0, 0
    while True:
        began_s = _computing_s()
        sensed = robot.sense() if floor is None else lost.believed(robot.sense())
        update = mapper.step(sensed, given_up.keys)
        scan = sensed if update.heard is None else update.heard.scan
        localisation = update.localisation
        if localisation.unstated_motion is not None:
            recent.move(localisation.unstated_motion)
            if floor is not None:
                floor.move(localisation.unstated_motion)
        if floor is not None and not localisation.is_lost:
            floor.see(update.map.belief.pose_world, scan)
        decides_s = _computing_s()
        seen = sorted({wall for wall in update.walls_of_segments.tolist() if wall >= 0})
        if not localisation.is_lost:
            graph.observe(update.map, update.chains, followed_wall(update.map), seen)
        around = Surroundings(
            walls=update.map,
            free_space=free_space,
            scan=scan,
            recent_robot=recent.points_robot,
            graph=graph.graph,
            odometry=odometry,
            seen=tuple(seen),
            nis=localisation.nis,
            is_lost=localisation.is_lost,
            is_leap_pending=localisation.is_leap_pending,
            fault=localisation.fault,
        )
        decision = driver.decide(around, update.chains, graph.graph)
        given_up = decision.given_up
        if decision.outcome is Outcome.ALL_CLOSED and not update.chains:
            decision = replace(decision, outcome=Outcome.NO_WALL, words="no wall was found")
        decided_s = _computing_s()
        yield Step(
            index=index,
            time_s=scan.time_s,
            odometry=odometry,
            scan=sensed,
            segments=update.segments,
            matches=update.matches,
            walls_of_segments=update.walls_of_segments,
            map=update.map,
            chains=update.chains,
            merged=update.merged,
            localisation=localisation,
            free_space=free_space,
            graph=graph.graph,
            decision=decision,
            path_length_m=path_length,
            seconds=decided_s - began_s,
            planning_seconds=decided_s - decides_s,
            robot=spec,
            own_beams=0 if update.heard is None else update.heard.own_beams,
            range_errors=update.range_errors,
        )
        if decision.command is None:
            return
        odometry = robot.drive(decision.command)
        mapper.predict(odometry)
        if floor is not None:
            floor.move(odometry)
        driver.moved(decision.command, odometry)
        lost.move(odometry)
        recent.see(scan)
        recent.move(odometry)
        path_length += odometry.path_m
        index += 1


def _computing_s() -> float:
    """Return the processor's time of this thread, s, without what it compiled in."""
    return time.thread_time() - compiling_s()
