"""A real robot's log through a back end; without ground truth, scores come from the map and the log alone."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.explore.mission import ride_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.sim.logs.bag_topics import TopicsWanted
from chainslam.sim.logs.keyframes import KeyframesConfig, RecordedLog
from chainslam.sim.logs.recorded_log import read_recorded_log
from chainslam.sim.logs.recorded_robot import RecordedRobot, RecordingError, read_log, recording_of
from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.mapper import Mapper

from ..artifacts.saved import cut_short, read_trial
from ..artifacts.settings import asked, record_of, trial_of
from ..scenario import OFFLINE, STRATEGY_OF_REPLAYS, OdometrySource, Scenario, TrialConfig, heard_by
from ..scoring.summary import Ending, odometry_poses
from ..trial import TrialResult
from ..usage import UsageError
from .motion_of_scans import motion_of_scans
from .paths.external import is_external, ride_external, without_map
from .paths.looked_again import PathMapper, looked_again
from .replay import OPEN_TO_REPLAYS
from .unwitnessed import every_scan, run_unwitnessed, unwitnessed

_BOW = {"bow_rad": SecondLooksConfig.floor_rad, "bow_m": SecondLooksConfig.floor_m}
REAL_WALLS = {"mission": {"mapper": {"walls": {"reliability": {"straightness": _BOW}}}}}
"""Standard deviation of real walls about their line: doors, panels and cupboards, in any log."""


FARTHEST_NOISE_M = 1.0
"""No range finder is as bad as this."""


@dataclass(frozen=True)
class RealOptions:
    """How a real robot's log is read."""

    every: int = 1
    """Every n-th keyframe is mapped."""
    odometry: OdometrySource | None = None
    """Source of the motion between two keyframes; None for that of the drive, or scan matching for logs of others."""
    second_looks: bool = False
    """Whether to refine offline once the drive has ended; without a back end, and with those that smooth, always."""
    range_noise: float | None = None
    """Standard deviation of a range, if the scanner's is known; None for the default of all logs."""
    scan_topic: str | None = None
    """Topic of the scans in a bag with several; None for the one with the widest view."""
    odom_topic: str | None = None
    """Topic of the odometry in a bag with several; None for the first by name."""


@dataclass(frozen=True)
class RealRun:
    """A real robot's log, and the settings to map it with."""

    name: str
    log: RecordedLog
    trial: TrialConfig
    options: RealOptions
    cut_short: str = ""
    """Why the drive or its log ended early, in words."""
    start_world: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    """The first pose: the origin of the map, unless the log goes on with a saved one."""

    @property
    def unread(self) -> str:
        """Why most of the log was not read, in words; empty if at least half of it was."""
        left_out, read = self.log.left_out, len(self.log.scan_time_s)
        return left_out.words(read) if left_out.count > read else ""

    @cached_property
    def wheels_alone(self) -> Float[np.ndarray, "s 3"]:
        """Poses of the wheel odometry at each keyframe, in the map's frame."""
        return odometry_poses(self.start_world, self.log.recording.odometry)


def read_real_run(
    path: Path, options: RealOptions, config: Path | None, named: Mapping[str, Any], robot: Mapping[str, Any]
) -> RealRun:
    """Read a log of a real robot; raises UsageError, in one line, where not one scan of it can be used.

    `robot` holds settings of what the robot states. Where its scanner sits the log itself has told.
    """
    if options.every < 1:
        raise UsageError(f"expected --every of 1 or more keyframes, found {options.every}: raise it")
    try:
        wanted = TopicsWanted(options.scan_topic, options.odom_topic)
        log = read_recorded_log(path, _keyframes(options), wanted, motion_of_scans)
    except RecordingError as error:
        raise UsageError(str(error)) from error
    options = replace(options, odometry=options.odometry or "scans")
    plain = TrialConfig(path.name, OFFLINE, STRATEGY_OF_REPLAYS, p0="zero")
    settled = record_of(plain).keys() - set(OPEN_TO_REPLAYS)
    at_axle = {"robot": {"scanner": record_of(plain)["robot"]["scanner"]}}
    trial = trial_of(record_of(plain), REAL_WALLS, robot, at_axle, asked(config, dict(named), settled))
    return RealRun(path.resolve().name, log, trial, options, log.trouble)


def _keyframes(options: RealOptions) -> KeyframesConfig:
    """Return the keyframes and their range noise; raises UsageError for an impossible noise."""
    plain, noise_m = KeyframesConfig(every=options.every), options.range_noise
    if noise_m is None:
        return plain
    if not 0.0 < noise_m < FARTHEST_NOISE_M:
        raise UsageError(f"expected a range noise in metres, found --range-noise {noise_m:g}: give about 0.001 to 0.1")
    return replace(plain, sigma_m=noise_m)


def read_own_run(
    path: Path, options: RealOptions, config: Path | None, named: Mapping[str, Any], robot: Mapping[str, Any]
) -> RealRun:
    """Read the `log.npz` of a robot of one's own and the `config.json` beside it; raises UsageError.

    Settings, odometry and noise are those of its drive. `robot` holds settings of what the robot states.
    """
    if options.range_noise is not None:
        raise UsageError(f"expected --range-noise with a log that does not state it, found {path.name}: leave it out")
    try:
        recording = recording_of(read_log(path))
    except RecordingError as error:
        raise UsageError(str(error)) from error
    trial = replace(read_trial(path.with_name("config.json")), strategy=STRATEGY_OF_REPLAYS)
    options = replace(options, odometry=options.odometry or trial.odometry)
    settled = record_of(trial).keys() - set(OPEN_TO_REPLAYS)
    trial = trial_of(record_of(trial), robot, asked(config, dict(named), settled))
    return RealRun(trial.world, every_scan(recording), trial, options, cut_short(path.parent))


def replayed_real(run: RealRun, backend: str) -> TrialConfig:
    """Return the settings of a log's replay through a back end."""
    return replace(run.trial, backend=backend)


def replay_real(run: RealRun, backend: str, watch: Callable[[Step], None] = lambda step: None) -> TrialResult:
    """Map a real robot's log with one back end, to its end or until it fails; raises UsageError before."""
    return looked_over(run, mapped_real(run, backend, watch))


def mapped_real(run: RealRun, backend: str, watch: Callable[[Step], None] = lambda step: None) -> TrialResult:
    """Map it, without offline refinement; for `OFFLINE`, add up its path."""
    scenario = unwitnessed(replayed_real(run, backend), RecordedRobot(run.log.recording), run.start_world)

    def mission(scenario: Scenario) -> Iterator[Step]:
        if is_external(backend):
            return ride_external(scenario, scenario.robot, len(run.log.recording), run.cut_short, run.unread)
        heard = heard_by(run.options.odometry or run.trial.odometry, scenario.robot, scenario.config)
        make = PathMapper if backend == OFFLINE else Mapper
        mapper = make(scenario.backend, scenario.config.mission.mapper)
        return ride_mission(heard, mapper, len(run.log.recording), run.cut_short, run.unread)

    result = run_unwitnessed(scenario, watch, mission, run.log)
    return replace(result, summary=without_map(result.summary)) if is_external(backend) else result


def looked_over(run: RealRun, result: TrialResult, watch: Callable[[float], None] = lambda share: None) -> TrialResult:
    """Return a mapped log after offline refinement, if it was asked for or there is no other map.

    `watch` hears of the share that is done. If it raises KeyboardInterrupt, what was found so far makes the map; if
    anything else does, the mapped result is kept.
    """
    is_offline, ended = result.scenario.config.backend == OFFLINE, result.ending
    asked_for = is_offline or run.options.second_looks or result.smoothed is not None
    if not asked_for or (ended.outcome is Outcome.INTERRUPTED and not is_offline):
        return result
    stopped = [ended] if ended.outcome is Outcome.INTERRUPTED else []

    def goes_on(share: float) -> bool:
        try:
            watch(share)
        except KeyboardInterrupt as interrupt:
            stopped.append(_interrupted(interrupt))
        return not stopped

    try:
        refined = looked_again(result, goes_on)
        return _ended(refined, stopped[0]) if stopped else refined
    except KeyboardInterrupt as interrupt:
        return replace(_ended(result, _interrupted(interrupt)), smoothed=None)


def _interrupted(interrupt: KeyboardInterrupt) -> Ending:
    return Ending(Outcome.INTERRUPTED, f"interrupted by {str(interrupt) or 'Ctrl-C'} during offline refinement")


def _ended(result: TrialResult, ending: Ending) -> TrialResult:
    said = {"status": ending.status, "reason": ending.reason, "outcome": str(ending.outcome)}
    return replace(result, ending=ending, summary=result.summary | said)
