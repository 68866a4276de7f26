"""The work for one trial: a pure function of its job, wherever it runs."""

import traceback
from dataclasses import dataclass, replace
from functools import lru_cache
from time import process_time
from types import GenericAlias
from typing import Any, Literal

import numpy as np
from msgspec import defstruct

from chainslam.sim.logs.archive import read_archive
from chainslam.sim.logs.recorded_robot import read_log
from chainslam.sim.worlds import DrawingOptions, World
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.mapper import Extractor
from chainslam.slam.robot import Scan

from ..artifacts.files import json_bytes, npz_bytes, stamp
from ..artifacts.presets import backend_of
from ..artifacts.reading import parse_json
from ..artifacts.results import log_arrays
from ..artifacts.schema import UnfitError
from ..replays.paths.external import is_external, without_map
from ..replays.replay import RecordedRun, ReplayOptions, replay, run_of
from ..scenario import TrialConfig, build, load_world
from ..scoring.maps.swept import SOON
from ..scoring.truth import truth_of
from ..trial import TrialResult, default_mission, run_scenario
from .plan import Trial, world_key
from .scores.innovation import InnovationEar
from .scores.observer import Observer
from .scores.score import TrialScores, record_of

SUMMARY = "summary_json"
"""Name of the summary in a trial's file."""

SCANS = tuple(key for key in SOON if key.endswith("_steps"))
NUMBERS = (
    *("path_length_m", "coverage", "swept", "pose_rmse_m", "heading_rmse_rad", "pose_anees", "pose_nees_in_band"),
    *("pose_anees_from_start", "nis", "nis_in_band"),
    *("map_anees", "joint_anees", "ate_m", "wall_rmse_m", "wall_shape_m", "nis_mean", "nis_whiteness", "trace_least"),
    *("trace_below", "bound_margin", "bound_first_m", "bound_worst_m"),
    *(key for key in SOON if key not in SCANS),
)
COUNTS = (
    *("duplicate_lines", "false_matches", "matches_true", "matches_missed", "matches_false", "merges"),
    *("false_merges", "steps", "collisions", *SCANS),
)
AT_A_MARK = (
    *("pose_error_m", "wall_rmse_m", "wall_shape_m", "pose_anees_so_far", "map_anees", "coverage"),
    *("path_length_m", "pose_nees", "joint_anees"),
)
AtAMark = defstruct(
    "AtAMark", [*((name, float | None, None) for name in AT_A_MARK), ("duplicate_lines", int | None, None)]
)
Summary = defstruct(
    "Summary",
    [
        *((name, str) for name in ("world", "backend", "strategy", "mode", "association", "reason")),
        ("seed", int),
        ("status", Literal["complete", "stopped", "failed"]),
        *((name, float | None, None) for name in NUMBERS),
        *((name, int | None, None) for name in COUNTS),
        ("set_aside", list[Any] | None, None),
        ("step_ms", dict[str, float | None] | None, None),
        ("marks", GenericAlias(dict, (str, AtAMark)) | None, None),
    ],
)
"""Keys of a trial's summary that the tables contain."""
LAYOUTS = {
    **dict.fromkeys(("path_length_m", "pose_nees", "pose_trace", "pose_error_m"), "float s"),
    "pose_nees_from_start": "float s",
    **dict.fromkeys(("heading_error_rad", "heading_sigma_rad"), "float s"),
    "lines": "int s",
    "map_ends": "float m 2 2",
    **dict.fromkeys(("map_closed", "map_tentative"), "bool m"),
    **dict.fromkeys(("path_estimated", "path_true"), "float s 2"),
    **dict.fromkeys(("distance_m", "distance_sigma_m", "distance_true_m"), "float p"),
    **dict.fromkeys(("coverage_path_m", "coverage"), "float c"),
    "nis": "float q",
    "nis_dof": "float q",
}
"""Layouts of a trial's arrays."""
HEARD = ("nis", "nis_dof")
LATER = ("pose_nees_from_start",)
"""Present only if innovations were recorded; of the others all are present, or none for a failed trial."""


@dataclass(frozen=True)
class Job:
    """A trial and all its inputs."""

    trial: Trial
    config: TrialConfig
    """World of the trial, or of the recording that it replays."""
    log: bytes | None = None
    """The recording's file, for a replay."""
    keep_log: bool = False
    """Whether replays use this drive."""


@dataclass(frozen=True)
class Done:
    """The result of a job: the contents of its files."""

    trial: Trial
    record: bytes
    log: bytes | None = None
    cpu_s: float = 0.0
    """Computing time of the job, s."""


def perform(job: Job) -> Done:
    """Run one trial; an error becomes its record, with the reason, and the campaign continues."""
    log, began = None, process_time()
    try:
        if job.trial.association is None:
            record, log = _drive(job)
        else:
            record = _replay(job)
    except Exception as error:  # a failed trial must not end a campaign of thousands
        record = failed(job, f"{type(error).__name__}: {' '.join(str(error).split())}", traceback.format_exc())
    if job.keep_log and log is None:
        log = npz_bytes({"reason": record.summary["reason"]})
    return Done(job.trial, pack(record), log, process_time() - began)


def failed(job: Job, reason: str, trace: str = "") -> TrialScores:
    """Return the record of a trial with a reason and nothing else."""
    config = job.config
    summary = {
        "seed": config.seed,
        "p0": config.p0,
        "errorless": config.errorless,
        "status": "failed",
        "reason": reason,
        "traceback": trace,
    }
    return TrialScores(_named(job.trial, summary), {})


def pack(record: TrialScores) -> bytes:
    """Return a record as the bytes of an archive without pickles."""
    return npz_bytes({SUMMARY: json_bytes(stamp() | record.summary).decode(), **record.arrays})


def unpack(content: bytes, trial: Trial) -> TrialScores:
    """Return the record in the bytes of a trial's file; raises ArchiveError or UnfitError for anything else."""
    arrays = read_archive(content, {SUMMARY: "text"}, LAYOUTS, others="float")
    summary = parse_json(str(arrays.pop(SUMMARY)).encode(), Summary)
    arrays.pop("format", None)
    for group in (HEARD, LATER, tuple(name for name in LAYOUTS if name not in (*HEARD, *LATER))):
        missing = [name for name in group if name not in arrays]
        if missing and len(missing) < len(group):
            raise UnfitError(f"no {missing[0]}")
    for name, value in _names(trial).items():
        if summary[name] != value:
            raise UnfitError(f"the result of another {name}")
    if summary["seed"] != trial.seed:
        raise UnfitError("the result of another seed")
    return TrialScores({key: value for key, value in summary.items() if key != "format"}, arrays)


def _named(trial: Trial, summary: dict[str, Any]) -> dict[str, Any]:
    """Return a summary under the trial's own names: a replay has the strategy of its recording."""
    names = _names(trial)
    return names | {key: value for key, value in summary.items() if key not in names}


def _names(trial: Trial) -> dict[str, str]:
    return {
        "world": world_key(trial.world),
        "backend": trial.backend,
        "strategy": trial.strategy,
        "mode": "closed" if trial.association is None else "replay",
        "association": trial.association or "own",
    }


@lru_cache(maxsize=2)
def _world(name: str, drawing: DrawingOptions) -> World:
    return load_world(name, drawing=drawing)


@lru_cache(maxsize=2)
def _recording(log: bytes, config: TrialConfig) -> RecordedRun:
    """Return a recording; since replays of one recording are consecutive, it is usually read once."""
    reason = read_archive(log, {}, {"reason": "text"}).get("reason")
    if reason is not None:
        raise RuntimeError(f"nothing was recorded: {reason}")
    return run_of(read_log(log), lambda: config)


@lru_cache(maxsize=2)
def remembered(log: bytes) -> Extractor:
    """Return an extraction that works out each scan of a recording once: whoever replays it sees the same segments."""
    known: dict[tuple[float, ExtractionConfig], Segments] = {}

    def extracted(scan: Scan, config: ExtractionConfig) -> Segments:
        key = scan.time_s, config
        if key not in known:
            known[key] = extract(scan, config)
            for values in vars(known[key]).values():
                if isinstance(values, np.ndarray):
                    values.setflags(write=False)
        return known[key]

    return extracted


def _drive(job: Job) -> tuple[TrialScores, bytes | None]:
    scenario = build(job.config, _world(job.config.world, job.config.drawing))
    walls = truth_of(scenario.world, job.config.robot).walls
    observer = Observer(walls, lambda index: scenario.robot.record.faces_of_beams[index])
    result = run_scenario(scenario, observer, default_mission)
    record = _finish(job, result, observer, None)
    log = result.log
    return record, npz_bytes(log_arrays(result, log)) if job.keep_log and log is not None else None


def _replay(job: Job) -> TrialScores:
    assert job.log is not None, "expected a recording to replay"
    run = _recording(job.log, job.config)
    world = _world(job.config.world, job.config.drawing)
    association = job.trial.association
    assert association is not None, "expected the arm of a replay"
    observer = Observer(truth_of(world, job.config.robot).walls, lambda index: run.true_face_of_beam[index])
    ear = InnovationEar(job.config.mission.mapper.walls.reliability) if association == "true" else None
    result = replay(
        run, backend_of(job.trial.backend), ReplayOptions(association), observer, world,
        ear.around if ear is not None else lambda matcher: matcher, remembered(job.log),
    )  # fmt: skip
    record = _finish(job, result, observer, ear)
    return replace(record, summary=without_map(record.summary)) if is_external(job.trial.backend) else record


def _finish(job: Job, result: TrialResult, observer: Observer, ear: InnovationEar | None) -> TrialScores:
    if result.ending.exit_status == 130:
        raise KeyboardInterrupt
    record = record_of(result, observer, ear)
    summary = record.summary | ({"traceback": result.ending.traceback} if result.ending.traceback else {})
    return TrialScores(_named(job.trial, summary), record.arrays)
