"""A run's own folder read again: its settings, and how to go on from where it stopped.

A run is decided by its settings alone, so going on means driving it once more from the start, past the place where
it stopped; that costs the time of the first part again, and leaves the bytes of a run that was never stopped. What the
robot reports on the way is held against the log, so that a world or a software that has changed since is noticed.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from explore.step import Step
from sim.replay import Recording, RecordingError, read_log, recording_of

from .reading import Each, Maybe, UnfitError, fit, read_json, told
from .scenario import TrialConfig, UsageError

TODO = "keep a run's files together, or make it anew"
NUMBERS = (
    *("path_length_m", "drive_time_s", "coverage", "coverage_own_frame", "swept", "pose_rmse_m", "heading_rmse_rad"),
    *("odometry_rmse_m", "odometry_max_m", "pose_anees", "pose_nees_in_band", "map_anees"),
)
COUNTS = (
    *("open_ends", "lines", "contours_closed", "contours_reachable", "false_matches", "duplicate_lines", "collisions"),
    "map_began_step",
)
SUMMARY = {
    "status": str,
    "reason": str,
    "steps": int,
    **{f"{name}?": float | None for name in NUMBERS},
    **{f"{name}?": int | None for name in COUNTS},
    "set_aside?": Maybe([{"wall": int, "side": int, "position_m": tuple[float, float], "why": str}]),
}
"""What pages and pictures take from a `summary.json`."""


@dataclass(frozen=True)
class SavedRun:
    """What a stopped run has left."""

    trial: TrialConfig
    recording: Recording

    def check(self, step: Step) -> None:
        """Raise UsageError where a step differs from the saved one of the same number."""
        if step.index >= len(self.recording):
            return
        same = np.array_equal(step.scan.ranges_m, self.recording.ranges_m[step.index], equal_nan=True)
        if not same or not np.array_equal(step.odometry.motion, self.recording.odometry[step.index]):
            raise UsageError(
                f"expected the saved run again, found another from step {step.index} on (the world, the software or"
                " the machine has changed): explore anew"
            )


def read_saved(folder: Path) -> SavedRun:
    """Read `config.json` and `log.npz` of a run; raises UsageError, in one line, for anything else."""
    trial = read_trial(folder / "config.json")
    try:
        return SavedRun(trial, recording_of(read_log(folder / "log.npz")))
    except RecordingError as error:
        raise UsageError(str(error)) from error


@dataclass(frozen=True)
class SavedConfig:
    """A run's `config.json`: what was run, as a replay or not, and by which versions."""

    trial: TrialConfig
    replay: Any
    """The options of a replay as they stand there; None for a run that drove."""
    versions: dict[str, str]
    commit: str | None


CONFIG = {"trial": TrialConfig, "versions?": Each(str), "commit?": str | None, "replay?": Any}


def read_config(path: Path) -> SavedConfig:
    """Read a run's `config.json`; raises UsageError, in one line, for anything else."""
    said = read_json(path, CONFIG, TODO)
    with told(path, TODO):
        for key in said.keys() - {"format", *(key.removesuffix("?") for key in CONFIG)}:
            raise UnfitError(f"an unknown {key[:40]!r}")
        trial: TrialConfig = fit(TrialConfig, said["trial"], "trial")
    return SavedConfig(trial, said.get("replay"), said.get("versions", {}), said.get("commit"))


def read_trial(path: Path) -> TrialConfig:
    """Read the settings of a run from its `config.json`; raises UsageError."""
    return read_config(path).trial


def read_summary(folder: Path) -> dict[str, Any]:
    """Read a run's `summary.json`; raises UsageError."""
    return read_json(folder / "summary.json", SUMMARY, TODO)
