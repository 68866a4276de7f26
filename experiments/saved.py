"""A run's own folder read again: its settings, and how to go on from where it stopped.

A run is decided by its settings alone, so going on means driving it once more from the start, past the place where
it stopped; that costs the time of the first part again, and leaves the bytes of a run that was never stopped. What the
robot reports on the way is held against the log, so that a world or a software that has changed since is noticed.
"""

import json
import types
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from explore.step import Step
from sim.replay import Recording, RecordingError, read_log, recording_of

from .scenario import TrialConfig, UsageError


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


def read_trial(path: Path) -> TrialConfig:
    """Read the settings of a run from its `config.json`; those that it does not name are as they are by default."""
    try:
        trial = from_record(TrialConfig, json.loads(path.read_text())["trial"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UsageError(
            f"expected the run's config.json in {path.parent}, found none that fits: keep a run's files together"
        ) from error
    assert isinstance(trial, TrialConfig)
    return trial


def from_record(kind: Any, value: Any) -> Any:
    """Return plain JSON values as the (nested) dataclass `kind` that they were; unknown keys are left out.

    Raises TypeError or ValueError where the values do not fit.
    """
    if is_dataclass(kind):
        if not isinstance(value, dict):
            raise TypeError(f"expected an object, found {value!r}")
        hints = get_type_hints(kind)
        named = [field.name for field in fields(kind) if field.name in value]
        return kind(**{name: from_record(hints[name], value[name]) for name in named})  # type: ignore[operator]
    if get_origin(kind) in (Union, types.UnionType):
        options = [option for option in get_args(kind) if option is not type(None)]
        return None if value is None else from_record(options[0], value)
    if get_origin(kind) is tuple:
        inner = get_args(kind)
        kinds = [inner[0]] * len(value) if inner[-1] is ... else inner
        return tuple(from_record(*pair) for pair in zip(kinds, value, strict=True))
    if kind is float:
        return float(value)
    if kind in (int, str, bool) and type(value) is not kind:
        raise TypeError(f"expected {kind.__name__}, found {value!r}")
    return value
