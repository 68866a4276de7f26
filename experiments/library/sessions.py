"""A later session in a building that a saved run has mapped: the robot finds its place there, and goes on mapping.

The robot begins lost. It explores with a map of its own until that map fits the saved one in one place only. Then the
saved run's scans, a carried motion to that place, and the scans so far are mapped in one go, so that the joint
covariance is that of one map of both sessions, by every back end.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from chainslam.explore.mission import explore_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import RecordedRobot, Recording
from chainslam.sim.robot import TrueRecord
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import MotionCommand, Odometry, Scan

from ..replays.recordings import recorded
from ..replays.replay import RecordedRun, replay
from ..replays.sources import OwnLog
from ..scenario import Scenario, TrialConfig, heard_by, make_backend
from ..trial import TrialResult, default_mission, run_scenario
from .earlier import Earlier, PlaceSought, driven_m, joined, read_earlier, told_of

Watch = Callable[[Step], None]


def seeking(sought: PlaceSought) -> Callable[[Scenario], Iterator[Step]]:
    """Return the mission of a robot that explores until its place in a saved map is found."""

    def mission(scenario: Scenario) -> Iterator[Step]:
        for step in default_mission(scenario):
            if step.outcome is None and sought.see(step):
                ended = replace(step.decision, outcome=Outcome.INTERRUPTED, words="placed in the saved map")
                yield replace(step, decision=ended)
                return
            yield step

    return mission


class LaterRobot:
    """Plays an earlier session and the begin of a later one, then goes on with the robot that drives the latter."""

    def __init__(
        self, played: Recording, earlier: RecordedRun, faces_of_beams: Int[np.ndarray, "s k"], begun: TrialResult
    ) -> None:
        """Play a recording of both; `begun` is what the robot did so far, and it is still at its last scan.

        `faces_of_beams` are those of the earlier session.
        """
        assert begun.log is not None
        self._played, self._live, self._at = RecordedRobot(played), begun.scenario.robot, -1
        self._scans, self._shift_s = len(played), float(played.time_s[-1] - begun.log.time_s[-1])
        self._poses = [*earlier.true_poses_world, *begun.log.true_world]
        self._faces = [*faces_of_beams, *begun.log.face_of_beam]
        self._before = TrueRecord(
            collisions=0 if played.touched is None else int(np.count_nonzero(played.touched[: len(faces_of_beams)])),
            drive_time_s=float(earlier.recording.time_s[-1]),
            path_length_m=driven_m(earlier.recording),
        )

    @property
    def record(self) -> TrueRecord:
        """The truth up to the last scan, of both sessions."""
        before, live = self._before, self._live.record
        return TrueRecord(
            self._poses[: self._at + 1],
            self._faces[: self._at + 1],
            before.collisions + live.collisions,
            before.drive_time_s + live.drive_time_s,
            before.path_length_m + live.path_length_m,
        )

    def sense(self) -> Scan:
        """Return the scan at the present pose."""
        self._at += 1
        if self._at < self._scans:
            return self._played.sense()
        scan = self._live.sense()
        self._poses.append(self._live.record.poses_world[-1])
        self._faces.append(self._live.record.faces_of_beams[-1])
        return replace(scan, time_s=scan.time_s + self._shift_s, start_s=scan.start_s + self._shift_s)

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command, or go to the next recorded scan."""
        return (self._played if self._at + 1 < self._scans else self._live).drive(command)


def together(recorded: int) -> Callable[[Scenario], Iterator[Step]]:
    """Return the mission of both sessions: it explores from the last of so many recorded scans on."""

    def mission(scenario: Scenario) -> Iterator[Step]:
        assert scenario.strategy is not None
        rules, robot = scenario.config.mission, heard_by(scenario.config.odometry, scenario.robot, scenario.config)
        return explore_mission(robot, Mapper(scenario.backend, rules.mapper), scenario.strategy, rules, recorded - 1)

    return mission


@dataclass(frozen=True)
class Begun:
    """A later session up to where its robot knows its place in the saved map, or to its end without one."""

    result: TrialResult
    """The session so far, with a map of its own."""
    later: Scenario | None
    """Both sessions as one; None where the place was not found."""
    recorded: int
    """Number of scans of both so far."""
    told: dict[str, Any]
    """What `summary.json` says of it."""


def placed_log(source: OwnLog, folder: Path, backend: str) -> tuple[OwnLog, dict[str, Any]]:
    """Return the log of both sessions as one, and what `summary.json` says of it; the log alone where the robot's place
    in the saved map is not found. Raises UsageError where there is no such map.
    """
    run = replace(source.run, trial=replace(source.run.trial, map=str(folder)))
    earlier = read_earlier(folder, run.trial)
    sought, way = PlaceSought(earlier.surface_world), list[np.ndarray]()
    carried: list[Odometry] = []

    def see(step: Step) -> None:
        way.append(step.map.belief.pose_world)
        if not carried and sought.see(step) and sought.found is not None:
            carried.append(earlier.carried_to(sought.found, np.array(way)))

    replay(run, backend, source.options, see, source.world)
    told = told_of(folder, sought, len(earlier.run.recording))
    if sought.found is None:
        return replace(source, run=run), told
    both = replace(
        run,
        recording=joined(earlier.run.recording, run.recording, carried[0]),
        start_pose=earlier.run.start_pose,
        start_cov=earlier.run.start_cov,
        true_poses_world=np.vstack([earlier.run.true_poses_world, run.true_poses_world]),
        true_face_of_beam=np.vstack([earlier.faces_in(source.world), run.true_face_of_beam]),
    )
    return replace(source, run=both), told


def begin_later(folder: Path, scenario: Scenario, watch: Watch) -> Begun:
    """Let the robot find its place in the map of a saved run; raises UsageError where there is none."""
    earlier = read_earlier(folder, scenario.config)
    sought = PlaceSought(earlier.surface_world)
    result = run_scenario(scenario, watch, seeking(sought))
    told = told_of(folder, sought, len(earlier.run.recording))
    if sought.found is None or result.log is None:
        result.summary["session"] = told
        return Begun(result, None, 0, told)
    later = later_session(earlier, result, sought.found)
    return Begun(result, later, len(earlier.run.recording) + len(result.log), told)


def later_session(earlier: Earlier, begun: TrialResult, place_world: Float[np.ndarray, "3"]) -> Scenario:
    """Return the scenario of both sessions as one, once the later one's robot is known to be at a place."""
    assert begun.log is not None
    scenario = begun.scenario
    carried = earlier.carried_to(place_world, begun.log.estimated_world)
    run, config = earlier.run, scenario.config
    played = joined(run.recording, recorded(begun).recording, carried)
    start, cov = run.start_pose, run.start_cov
    return replace(
        scenario,
        config=_beyond(run, config),
        world=replace(scenario.world, start=run.true_poses_world[0]),
        robot=LaterRobot(played, run, earlier.faces_in(scenario.world), begun),
        backend=make_backend(config, start, cov),
        start_estimate=start,
        start_cov=cov,
    )


def _beyond(run: RecordedRun, config: TrialConfig) -> TrialConfig:
    """Return settings whose limits count the later session alone."""
    way_m, time_s = driven_m(run.recording), float(run.recording.time_s[-1])
    return replace(
        config,
        max_steps=config.max_steps + len(run.recording),
        max_path_m=None if config.max_path_m is None else config.max_path_m + way_m,
        time_limit_s=None if config.time_limit_s is None else config.time_limit_s + time_s,
    )
