"""A robot without ground truth: it explores or plays a recording, and is scored from its map alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.explore.certificate import certify
from chainslam.explore.step import Step
from chainslam.sim.logs.keyframes import RecordedLog
from chainslam.sim.logs.recorded_robot import Recording
from chainslam.slam.robot import MotionCommand, Odometry, Robot, Scan

from ..scenario import STRATEGY_OF_REPLAYS, Scenario, TrialConfig, check, make_backend, strategy_of
from ..scoring.records import Log, Recorder
from ..scoring.without_truth.certificate import certificate_record
from ..scoring.without_truth.smoothing import smooth
from ..scoring.without_truth.unseen_floor import unseen_now
from ..scoring.without_truth.unwitnessed import (
    NoVotes,
    UnwitnessedRecord,
    no_truth,
    summarise_unwitnessed,
    unseen_world,
)
from ..trial import Mission, TrialResult, bare_summary, ride

START_SIGMAS = (1e-4, 1e-4, 1e-5)
"""The first pose is the origin of the map and known exactly, m m rad."""


class UnwitnessedRobot:
    """Any robot, with a record of its drive that lacks the truth."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._record = robot, UnwitnessedRecord()

    @property
    def record(self) -> UnwitnessedRecord:
        """Record of the truth: empty."""
        return self._record

    def sense(self) -> Scan:
        """Return the scan at the present pose."""
        scan = self._robot.sense()
        self._record.sensed(len(scan.ranges_m))
        return scan

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command and return the odometry."""
        return self._robot.drive(command)


ORIGIN = np.zeros(3)
"""Where a map begins."""


def unwitnessed(config: TrialConfig, robot: Robot, start_world: Float[np.ndarray, "3"] = ORIGIN) -> Scenario:
    """Return the scenario of a robot in an unknown building; raises UsageError for unknown names."""
    check(config)
    start, cov = start_world, np.diag(np.square(START_SIGMAS))
    strategy = None if config.strategy == STRATEGY_OF_REPLAYS else strategy_of(config.strategy)
    return Scenario(
        config,
        unseen_world(config.world),
        UnwitnessedRobot(robot),
        make_backend(config, start, cov),
        strategy,
        start,
        cov,
    )


def run_unwitnessed(
    scenario: Scenario, watch: Callable[[Step], None], mission: Mission, recorded: RecordedLog | None = None
) -> TrialResult:
    """Run a scenario without ground truth to its end and return everything that was computed.

    `recorded` is the log that the robot plays; for a robot that drives itself its own steps are used.
    """
    votes = NoVotes(no_truth(scenario.world))
    recorder = Recorder(scenario.robot, votes)
    ending = ride(scenario, recorder, watch, mission)
    recorder.close()
    if recorder.last is None:
        return TrialResult(scenario, ending, None, votes, None, None, None, bare_summary(scenario, ending))
    log, last, explorer = recorder.log(), recorder.last, scenario.config.mission.explorer
    certificate = certify(last, ending.outcome, explorer.following.paths, explorer.sweep, log.estimated_world[:, :2])
    summary: dict[str, Any] = summarise_unwitnessed(scenario, log, votes, last, ending)
    summary |= {"certificate": certificate_record(certificate, unseen_now(last))}
    smoothed = smooth(scenario.backend, last.map, log.unstated_motion, scenario.config.robot.scanner)
    log_of_robot = recorded or _own_log(log)
    return TrialResult(scenario, ending, log, votes, last, recorder.joint, certificate, summary, smoothed, log_of_robot)


def _own_log(log: Log) -> RecordedLog:
    """Return the reports of a robot on its own drive."""
    return every_scan(
        Recording(
            log.time_s, log.bearings_rad, log.ranges_m, log.sigma_m, log.range_max_m, log.odometry, log.odometry_cov,
            log.touched, log.sigma_share, log.scan_start_s, log.fans, log.resolution_m,
        )
    )  # fmt: skip


def every_scan(recording: Recording) -> RecordedLog:
    """Return a recording as a log in which every scan is a keyframe."""
    steps = len(recording)
    return RecordedLog(
        recording, recording.time_s, np.arange(steps), np.zeros((steps, 3)), np.zeros(steps), np.zeros(3)
    )
