"""A run's own log through a back end: identical scans, the back end alone; truth and oracles from the same log."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int

from chainslam.explore.mission import ride_mission
from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import (
    MOST_M,
    TRUTH,
    RecordedRobot,
    Recording,
    RecordingError,
    are_covariances,
    read_log,
    recording_of,
    within,
)
from chainslam.sim.robot import TrueRecord, chance_in
from chainslam.sim.worlds import World
from chainslam.slam.association.methods import METHODS, Matcher
from chainslam.slam.config import MapperConfig
from chainslam.slam.estimation.mounting import scanner_poses
from chainslam.slam.extraction.extract import extract
from chainslam.slam.mapper import Extractor, Mapper
from chainslam.slam.robot import MotionCommand, Odometry, Scan

from ..artifacts.reading import told
from ..artifacts.saved import cut_short, read_config, read_trial
from ..artifacts.schema import fit
from ..artifacts.settings import asked, record_of, trial_of
from ..scenario import (
    STRATEGY_OF_REPLAYS,
    OdometrySource,
    Scenario,
    TrialConfig,
    check,
    heard_by,
    load_world,
    make_backend,
)
from ..scoring.truth import truth_of
from ..trial import TrialResult, run_scenario
from ..usage import UsageError
from .oracles import PerfectExtraction, TrueAssociation, Witness, of_true_lines, true_odometry
from .paths.external import is_external, ride_external, without_map

Association = Literal["own", "true"]
OPEN_TO_REPLAYS = ("mission", "backend_options")
"""The settings that a replay may change; all others are fixed by the log."""


@dataclass(frozen=True)
class ReplayOptions:
    """The parts of the software that the truth replaces."""

    association: Association = "own"
    """Data association: the back end's own, or the true one."""
    perfect_extraction: bool = False
    """Replace the extracted segments by true lines with noise of exactly the stated covariance."""
    perfect_odometry: bool = False
    """Replace the reported motions by the true ones; the stated covariance stays."""
    odometry: OdometrySource | None = None
    """Source of the motion between two scans; None for that of the run."""


@dataclass(frozen=True)
class RecordedRun:
    """A run's own log with the truth, and its settings."""

    trial: TrialConfig
    recording: Recording
    start_pose: Float[np.ndarray, "3"]
    start_cov: Float[np.ndarray, "3 3"]
    true_poses_world: Float[np.ndarray, "s 3"]
    true_face_of_beam: Int[np.ndarray, "s k"]
    true_faces: Float[np.ndarray, "f 2 2"] | None = None
    """The faces of its world; None where the world itself is at hand."""
    cut_short: str = ""
    """Why the drive ended early, in words."""


def read_run(log: Path) -> RecordedRun:
    """Read `log.npz` and the `config.json` beside it; raises UsageError, in one line, for anything else."""
    try:
        arrays = read_log(log)
    except RecordingError as error:
        raise UsageError(str(error)) from error
    run = run_of(arrays, lambda: read_trial(log.with_name("config.json")))
    return replace(run, cut_short=cut_short(log.parent))


def is_same_drive(one: RecordedRun, other: RecordedRun) -> bool:
    """Return whether two logs have the same scans and odometry."""
    a, b = one.recording, other.recording
    return np.array_equal(a.ranges_m, b.ranges_m, equal_nan=True) and np.array_equal(a.odometry, b.odometry)


def read_options(config: Path) -> ReplayOptions:
    """Return the options of the replay in a `config.json`, or the default ones for an exploration."""
    said = read_config(config).replay
    if said is None:
        return ReplayOptions()
    with told(config, "keep a run's files together, or repeat the run"):
        return fit(ReplayOptions, said, "replay")


def run_of(arrays: dict[str, np.ndarray], trial: Callable[[], TrialConfig]) -> RecordedRun:
    """Return the run in the arrays of a `log.npz`; raises UsageError if they are inconsistent."""
    try:
        recording = recording_of(arrays)
    except RecordingError as error:
        raise UsageError(str(error)) from error
    missing = [name for name in TRUTH if name not in arrays]
    if missing:
        raise UsageError(
            f"expected a log with the truth, found none of {', '.join(missing)}: replay a simulated run,"
            " or a real robot's log itself"
        )
    poses, cov, faces = arrays["true_poses"], arrays["start_cov"], arrays["true_face_of_beam"]
    numbers = (poses, cov, arrays["start_pose"], arrays["true_faces"])
    known = faces.min(initial=-1) >= -1 and faces.max(initial=-1) < len(arrays["true_faces"])
    if not known or not all(within(values, MOST_M) for values in numbers) or not are_covariances(cov):
        raise UsageError(
            "expected a log with the truth, found one that does not come from a simulated run: record it again"
        )
    return RecordedRun(trial(), recording, arrays["start_pose"], cov, poses, faces, arrays["true_faces"])


class ReplayedRobot(RecordedRobot):
    """A recorded robot that also keeps the true record of the recording."""

    def __init__(self, run: RecordedRun, recording: Recording) -> None:
        super().__init__(recording)
        self._run = run
        self._record = TrueRecord()

    @property
    def record(self) -> TrueRecord:
        """The truth up to the last scan."""
        return self._record

    def sense(self) -> Scan:
        """Return the present scan and record the truth about it."""
        at = len(self._record.poses_world)
        self._record.poses_world.append(self._run.true_poses_world[at])
        self._record.faces_of_beams.append(self._run.true_face_of_beam[at])
        return super().sense()

    def drive(self, command: MotionCommand) -> Odometry:
        """Go to the next scan."""
        odometry = super().drive(command)
        self._record.path_length_m += odometry.path_m
        self._record.collisions += odometry.touched
        return odometry


def retuned(
    run: RecordedRun, config: Path | None, named: Mapping[str, Any], robot: Mapping[str, Any] | None = None
) -> RecordedRun:
    """Return a run to be replayed with the settings of a file and some by name over its own; raises UsageError.

    `robot` holds settings of what the robot states, over the run's own.
    """
    settled = record_of(run.trial).keys() - set(OPEN_TO_REPLAYS)
    return replace(run, trial=trial_of(record_of(run.trial), robot or {}, asked(config, dict(named), settled)))


def replayed(run: RecordedRun, backend: str) -> TrialConfig:
    """Return the settings of a recording's replay through a back end."""
    return replace(run.trial, backend=backend, strategy=STRATEGY_OF_REPLAYS)


def replay(
    run: RecordedRun,
    backend: str,
    options: ReplayOptions = ReplayOptions(),
    watch: Callable[[Step], None] = lambda step: None,
    world: World | None = None,
    around: Callable[[Matcher], Matcher] = lambda matcher: matcher,
    extractor: Extractor = extract,
) -> TrialResult:
    """Map a recording with one back end; raises UsageError before anything is computed.

    `world` saves loading it again; `around` may wrap the matcher, to listen to it; `extractor` finds the
    segments of a scan unless the options put the truth in its place.
    """
    config = replayed(run, backend)
    check(config)
    world = world or load_world(config.world, config.start, config.drawing)
    recording = run.recording
    if recording.carried is not None:  # Start and limits in the settings are those of the last session.
        world = replace(world, start=run.true_poses_world[0])
        config = replace(config, max_steps=len(recording) + 1, max_path_m=None, time_limit_s=None)
    if options.perfect_odometry:
        recording = replace(recording, odometry=true_odometry(run.true_poses_world))
    backend_made = make_backend(config, run.start_pose, run.start_cov)
    robot = ReplayedRobot(run, recording)
    scenario = Scenario(config, world, robot, backend_made, None, run.start_pose, run.start_cov)
    scanner_world = scanner_poses(run.true_poses_world, config.robot.true_scanner)
    witness = Witness(truth_of(world, config.robot), scanner_world, run.true_face_of_beam)
    if len(witness.truth.faces) <= int(run.true_face_of_beam.max(initial=-1)):
        raise UsageError(
            f"expected the world in which the log was recorded, found that {config.world} has changed: restore it"
        )
    chance = chance_in(world, config.seed)
    oracle = TrueAssociation(witness) if options.association == "true" else None

    def learn(step: Step) -> None:
        if oracle is not None:
            oracle.learn(step.walls_of_segments)
        witness.at += 1
        watch(step)

    def mission(scenario: Scenario) -> Iterator[Step]:
        if is_external(backend):
            return ride_external(scenario, robot, len(recording), run.cut_short, extractor=extractor)
        rules = scenario.config.mission.mapper if oracle is None else _without_housekeeping(config.mission.mapper)
        rules = of_true_lines(rules) if options.perfect_extraction else rules
        mapper = Mapper(
            scenario.backend,
            rules,
            PerfectExtraction(witness, chance) if options.perfect_extraction else extractor,
            around(METHODS[rules.matching.method].matcher if oracle is None else oracle),
        )
        heard = heard_by(options.odometry or config.odometry, robot, config)
        return ride_mission(heard, mapper, len(recording), run.cut_short)

    result = run_scenario(scenario, learn, mission)
    return replace(result, summary=without_map(result.summary)) if is_external(backend) else result


def _without_housekeeping(config: MapperConfig) -> MapperConfig:
    """Return a mapper that never deletes, splits or merges a wall: with true association nothing needs repair."""
    return replace(config, walls=replace(config.walls, housekeeping=False), merging=None)
