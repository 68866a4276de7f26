"""A run read from its folder: its settings, and how to continue it.

The settings alone determine a run. To continue, it is therefore driven again from the start, past the point where it
stopped: this takes the time of the first part again, and gives the same bytes as an uninterrupted run. The robot's
reports are compared with the log on the way, which detects a world or software that has changed since. A killed run has
no `log.npz`, or an older one, but its running log (`running_log.py`).
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from jaxtyping import Float
from msgspec import Struct, defstruct

from chainslam.explore.limits import Limits
from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import RecordingError, read_log, recording_of

from ..scenario import STRATEGY_OF_REPLAYS, TrialConfig
from ..scoring.keys import Summary
from ..usage import UsageError
from .files import CONFIG
from .reading import check_format, plain_json, read_json, read_plain, told
from .results import LOG, RUNNING
from .running_log import Kept, read_running
from .schema import fit

REMEDY = "keep a run's files together, or repeat the run"
ALWAYS = ("status", "reason", "steps")
Saved = defstruct(
    "Saved",
    [(key, kind) if key in ALWAYS else (key, kind, None) for key, kind in get_type_hints(Summary).items()],
    kw_only=True,
)
"""`Summary` as it is read: a key that another version did not write is not missed."""


Known = defstruct("Known", [("outcome", str)])


class Ended(Struct):
    """The keys of every `summary.json` that describe the end of the run."""

    status: str
    reason: str


@dataclass(frozen=True)
class SavedRun:
    """The results of a stopped or killed run; s steps, k beams."""

    trial: TrialConfig
    outcome: Outcome | None
    """The outcome in the saved results; None if they are incomplete."""
    kept: Kept | None
    """The running log of a killed run; None if all results were written."""
    time_s: Float[np.ndarray, " s"]
    ranges_m: Float[np.ndarray, "s k"]
    odometry: Float[np.ndarray, "s 3"]

    def __len__(self) -> int:
        return len(self.time_s)

    def check(self, step: Step) -> None:
        """Raise UsageError if a step differs from the saved one with the same number."""
        if step.index >= len(self):
            return
        same = np.array_equal(step.scan.ranges_m, self.ranges_m[step.index], equal_nan=True)
        if not same or not np.array_equal(step.odometry.reported.motion, self.odometry[step.index]):
            raise UsageError(
                f"expected the saved run to repeat, found a difference at step {step.index} (the world, the software"
                " or the machine has changed): start a new run"
            )

    def is_finished(self, trial: TrialConfig) -> bool:
        """Return whether driving again with these settings would give the same results."""
        if self.kept is not None or self.outcome is None or self.outcome in (Outcome.INTERRUPTED, Outcome.FAILED):
            return False
        if self.outcome.status == "complete":
            # It ended by itself: a larger limit does not make it longer.
            saved = self.trial
            trial = replace(
                trial, max_steps=saved.max_steps, max_path_m=saved.max_path_m, time_limit_s=saved.time_limit_s
            )
        return trial == self.trial

    def outlasts(self, limits: Limits) -> bool:
        """Return whether the saved run is longer than these limits allow."""
        if self.outcome is None or not len(self):
            return False
        way_m = np.cumsum(np.hypot(self.odometry[:-1, 0], self.odometry[:-1, 1]))
        return (
            (limits.steps is not None and limits.steps < len(self))
            or (limits.path_m is not None and bool(np.any(way_m >= limits.path_m)))
            or (limits.time_s is not None and bool(np.any(self.time_s[:-1] >= limits.time_s)))
        )


def read_saved(folder: Path) -> SavedRun:
    """Read the results of a run, however it ended; raises UsageError if it cannot be continued."""
    kept = read_running(folder)
    config = read_config(folder / CONFIG) if kept is None else _config_in(kept, folder / RUNNING)
    trial = config.trial
    if trial.strategy == STRATEGY_OF_REPLAYS:
        raise UsageError(f"expected the folder of an exploration, found that of a replay in {folder}: replay again")
    time_s, ranges_m, odometry = np.empty(0), np.empty((0, 0)), np.empty((0, 3))
    outcome = None
    if (folder / LOG).exists():
        outcome = _outcome(folder / "summary.json")
        try:
            log = recording_of(read_log(folder / LOG))
        except RecordingError as error:
            raise UsageError(str(error)) from error
        time_s, ranges_m, odometry = log.time_s, log.ranges_m, log.odometry
    if kept is not None and len(kept.time_s) > len(time_s):
        time_s, ranges_m, odometry = kept.time_s, kept.ranges_m, kept.odometry
    return SavedRun(trial, outcome, kept, time_s, ranges_m, odometry)


def _outcome(summary: Path) -> Outcome | None:
    try:
        return Outcome(read_json(summary, Known, REMEDY)["outcome"])
    except ValueError:
        return None


@dataclass(frozen=True)
class SavedConfig:
    """A run's `config.json`: what was run, whether as a replay, and by which versions."""

    format: int
    trial: TrialConfig
    versions: dict[str, str] = field(default_factory=dict)
    commit: str | None = None
    replay: Any = None
    """The options of a replay; None for an exploration."""


def read_config(path: Path) -> SavedConfig:
    """Read a run's `config.json`; raises UsageError for anything else."""
    with told(path, REMEDY):
        return _config_of(read_plain(path))


def _config_in(kept: Kept, path: Path) -> SavedConfig:
    with told(path, REMEDY):
        return _config_of(fit(dict, plain_json(kept.config)))


def _config_of(said: dict[str, Any]) -> SavedConfig:
    check_format(said)
    return fit(SavedConfig, {"versions": {}, "commit": None, "replay": None} | said)


def read_trial(path: Path) -> TrialConfig:
    """Read the settings of a run from its `config.json`; raises UsageError."""
    return read_config(path).trial


def cut_short(folder: Path) -> str:
    """Return in words what ended the run in a folder early; nothing where it came to its end, or no summary is there.

    Raises UsageError for a summary that is none.
    """
    if not (folder / "summary.json").exists():
        return ""
    said = read_json(folder / "summary.json", Ended, REMEDY)
    return "" if said["status"] == "complete" else str(said["reason"])


def read_summary(folder: Path) -> dict[str, Any]:
    """Read a run's `summary.json`; raises UsageError."""
    return read_json(folder / "summary.json", Saved, REMEDY)
