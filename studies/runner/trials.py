"""Many trials, a row for each with all that was scored of it."""

import time
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from chainslam.experiments.scenario import TrialConfig, check, load_world
from chainslam.experiments.scoring.summary import TIMED
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError
from chainslam.sim.worlds import World

from . import rows
from .rows import Row

PLAIN = (str, int, float, bool)
PARTS = 10
"""A run is cut into so many parts of equal numbers of steps, to see whether steps grow slower."""
SETTINGS = ("seed", "backend", "strategy", "errorless", "p0", "max_steps")
KEYS = ("file", *SETTINGS)
"""What makes a trial this one and no other."""


def scored(
    trials: Sequence[TrialConfig],
    path: Path,
    known_by: Callable[[TrialConfig], Row],
    score: Callable[[TrialConfig], Row],
    jobs: int,
) -> list[Row]:
    """Return a row for each trial, what it is known by and its scores; those that the file lacks are run first.

    Raises UsageError for bad names and for a file that holds something else.
    """
    for trial in trials:
        check(trial)
    names = tuple(known_by(trials[0]))
    numbered = [(number, [rows.key_of(known_by(trial), names)]) for number, trial in enumerate(trials)]
    return list(rows.rows_of(path, names, numbered, partial(_scored, tuple(trials), known_by, score), jobs))


def _scored(
    trials: Sequence[TrialConfig],
    known_by: Callable[[TrialConfig], Row],
    score: Callable[[TrialConfig], Row],
    number: int,
) -> list[Row]:
    return [known_by(trials[number]) | score(trials[number])]


def rows_of(trials: Sequence[TrialConfig], path: Path, jobs: int, any_code: bool = False) -> Iterator[Row]:
    """Run what the file lacks of the trials, append each row as it comes, and yield the rows of all of them.

    With `any_code` a row counts whatever version of the code made it.

    Raises UsageError for bad names and for a file that holds something else.
    """
    check(trials[0])
    numbered = [(number, [rows.key_of(_settings(trial), KEYS)]) for number, trial in enumerate(trials)]
    return rows.rows_of(path, KEYS, numbered, partial(_one_of, tuple(trials)), jobs, any_code)


def _one_of(trials: Sequence[TrialConfig], number: int) -> Sequence[Row]:
    return [one(trials[number])]


def one(config: TrialConfig) -> Row:
    """Run one trial and return its row: the summary's plain values, distances, step times by name, memory."""
    began, row = time.process_time(), _settings(config)
    _forget_peak()
    try:
        result = run_trial(config, world=_world(config.world))
    except UsageError as error:
        return row | {"world": Path(config.world).stem, "status": "not loaded", "reason": str(error)}
    except Exception as error:  # a trial that cannot even be scored is a row of the table, not the end of it
        reason = f"{type(error).__name__}: {error}"
        return row | {"world": Path(config.world).stem, "status": "failed", "reason": reason, "raised": True}
    summary = result.summary
    row |= {key: value for key, value in summary.items() if value is None or isinstance(value, PLAIN)}
    for timed in TIMED:
        row |= {f"{timed}_{key}": value for key, value in (summary[timed] or {}).items()}
    for pair, distance in summary.get("distances", {}).items():
        mapped = distance["mapped_m"]
        row[f"distance_error_{pair}_m"] = None if mapped is None else mapped - distance["true_m"]
    row["raised"] = bool(result.ending.traceback)
    row["recoveries"] = getattr(result.scenario.backend, "recoveries", None)
    row["set_aside"] = len(summary.get("set_aside", []))
    row["reachable_way"] = summary.get("certificate", {}).get("reachable_way")
    if result.log is not None:
        parts = np.array_split(1e3 * result.log.seconds, PARTS)
        larger = np.flatnonzero(result.log.wheel_noise_factor > 1.0)
        row["wheel_noise_step"] = int(larger[0]) if len(larger) else None
        row["step_ms_along"] = [float(part.mean()) if len(part) else None for part in parts]
    return row | {"processor_s": time.process_time() - began, "peak_mib": _peak_mib()}


@lru_cache(maxsize=2)
def _world(name: str) -> World:
    return load_world(name)


def _settings(trial: TrialConfig) -> Row:
    return {"file": Path(trial.world).name} | {name: getattr(trial, name) for name in SETTINGS}


def _forget_peak() -> None:
    """Let Linux count this process's highest resident memory anew: a worker runs one trial after another."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def _peak_mib() -> float | None:
    """Return the highest resident memory of this process since it was forgotten, MiB; None where nobody tells."""
    try:
        status = Path("/proc/self/status").read_text()
    except OSError:
        return None
    found = [line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:")]
    return int(found[0]) / 1024 if found else None
