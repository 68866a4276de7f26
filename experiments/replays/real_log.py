"""A real robot's log through a back end: no truth is known, so what is scored is what the map and the log tell."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from explore.certificate import certify
from explore.mission import ride_mission
from explore.step import Step
from sim.logs.keyframes import KeyframesConfig, RecordedLog
from sim.logs.recorded_log import read_recorded_log
from sim.logs.recorded_robot import RecordedRobot, RecordingError
from slam.backends import BACKENDS
from slam.mapper import Mapper
from slam.robot import Scan

from ..artifacts.settings import asked, record_of, trial_of
from ..scenario import STRATEGY_OF_REPLAYS, Scenario, TrialConfig, check
from ..scoring.certificate import certificate_record
from ..scoring.records import Recorder
from ..scoring.smoothing import smooth
from ..scoring.summary import odometry_poses
from ..scoring.unwitnessed import NoVotes, UnwitnessedRecord, no_truth, summarise_unwitnessed, unseen_world
from ..trial import TrialResult, bare_summary, ride
from ..usage import UsageError
from .replay import OPEN_TO_REPLAYS, OdometrySource, heard_by

START_SIGMAS = (1e-4, 1e-4, 1e-5)
"""The first scan is the map's frame: the pose there is known, m m rad."""


@dataclass(frozen=True)
class RealOptions:
    """How a real robot's log is taken."""

    every: int = 1
    """One of so many keyframes is mapped."""
    odometry: OdometrySource = "scans"
    """Who tells the motion between two keyframes."""


@dataclass(frozen=True)
class RealRun:
    """A real robot's log, and the settings to map it with."""

    name: str
    log: RecordedLog
    trial: TrialConfig
    options: RealOptions

    @cached_property
    def wheels_alone(self) -> Float[np.ndarray, "s 3"]:
        """Where the wheels alone say that the robot was at each keyframe, in the map's frame."""
        return odometry_poses(np.zeros(3), self.log.recording.odometry)


def read_real_run(
    path: Path, options: RealOptions, config: Path | None, sets: Sequence[str], robot: Mapping[str, Any]
) -> RealRun:
    """Read a log of a real robot; raises UsageError, in one line, where not one scan of it can be used.

    `robot` holds settings of what the robot states. Where its scanner sits the log itself has told.
    """
    if options.every < 1:
        raise UsageError(f"expected each keyframe or one of so many, found --every {options.every}: give 1 or more")
    try:
        log = read_recorded_log(path, KeyframesConfig(every=options.every))
    except RecordingError as error:
        raise UsageError(str(error)) from error
    plain = TrialConfig(path.name, strategy=STRATEGY_OF_REPLAYS, p0="zero")
    settled = record_of(plain).keys() - set(OPEN_TO_REPLAYS)
    at_axle = {"robot": {"scanner": record_of(plain)["robot"]["scanner"]}}
    return RealRun(path.name, log, trial_of(record_of(plain), robot, at_axle, asked(config, sets, settled)), options)


class RealRobot(RecordedRobot):
    """A recorded robot of which nobody knows the truth."""

    def __init__(self, log: RecordedLog) -> None:
        super().__init__(log.recording)
        self._record = UnwitnessedRecord()

    @property
    def record(self) -> UnwitnessedRecord:
        """What is known of what really happened: nothing."""
        return self._record

    def sense(self) -> Scan:
        """Return the present scan."""
        scan = super().sense()
        self._record.sensed(len(scan.ranges_m))
        return scan


def replayed_real(run: RealRun, backend: str) -> TrialConfig:
    """Return the settings of a log's replay through a back end."""
    return replace(run.trial, backend=backend)


def replay_real(run: RealRun, backend: str, watch: Callable[[Step], None] = lambda step: None) -> TrialResult:
    """Map a real robot's log with one back end, to its end or to what ends it early; raises UsageError before."""
    config = replayed_real(run, backend)
    check(config)
    start, cov = np.zeros(3), np.diag(np.square(START_SIGMAS))
    world, robot = unseen_world(run.name), RealRobot(run.log)
    made = BACKENDS[backend].make(start.copy(), cov.copy(), config.backend_options)
    scenario = Scenario(config, world, robot, made, None, start, cov)

    def mission(scenario: Scenario) -> Iterator[Step]:
        heard = heard_by(run.options.odometry, robot, config)
        return ride_mission(heard, Mapper(made, config.mission.mapper), len(run.log.recording))

    votes = NoVotes(no_truth(world))
    recorder = Recorder(robot, votes)
    ending = ride(scenario, recorder, watch, mission)
    recorder.close()
    if recorder.last is None:
        return TrialResult(scenario, ending, None, votes, None, None, None, bare_summary(scenario, ending))
    log, last, explorer = recorder.log(), recorder.last, config.mission.explorer
    certificate = certify(last, ending.outcome, explorer.following.paths, explorer.sweep, log.estimated_world[:, :2])
    summary = summarise_unwitnessed(scenario, log, votes, last, ending)
    summary |= {"certificate": certificate_record(certificate)}
    smoothed = smooth(made, last.map, log.unstated_motion, config.robot.scanner)
    return TrialResult(scenario, ending, log, votes, last, recorder.joint, certificate, summary, smoothed, run.log)
