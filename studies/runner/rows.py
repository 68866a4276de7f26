"""Many trials, a line of JSON for each, written as it comes: begun again, they go on where they were interrupted."""

import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import explore
import sim
import slam
from experiments.scenario import TrialConfig, check, load_world
from experiments.scoring.summary import TIMED
from experiments.trial import run_trial
from experiments.usage import UsageError
from sim.worlds import World

Row = dict[str, Any]
PLAIN = (str, int, float, bool)
PARTS = 10
"""A run is cut into so many parts of equal numbers of steps, to see whether steps grow slower."""
SETTINGS = ("seed", "backend", "strategy", "errorless", "p0", "max_steps")
KEYS = ("code", "file", *SETTINGS)
"""What makes a trial this one and no other."""


def rows_of(trials: Sequence[TrialConfig], path: Path, jobs: int) -> Iterator[Row]:
    """Run what the file lacks of the trials, append each row as it comes, and yield the rows of all of them.

    Rows of other code stay in the file and count for nothing. Raises UsageError for bad names and for a file that
    holds something else.
    """
    check(trials[0])
    wanted = {_key(_settings(trial)): trial for trial in trials}
    kept, rows = _read(path)
    for row in rows:
        if wanted.pop(_key(row), None) is not None:
            yield row
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab") as file:
        file.truncate(kept)
        for row in results(list(wanted.values()), jobs):
            file.write(json.dumps(row).encode() + b"\n")
            file.flush()
            yield row


def results(trials: Sequence[TrialConfig], jobs: int) -> Iterator[Row]:
    """Run trials in several processes and yield the row of each as it ends."""
    if jobs <= 1:
        yield from map(one, trials)
        return
    with ProcessPoolExecutor(jobs) as pool:
        for future in as_completed([pool.submit(one, trial) for trial in trials]):
            yield future.result()


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
        row["step_ms_along"] = [float(part.mean()) if len(part) else None for part in parts]
    return row | {"processor_s": time.process_time() - began, "peak_mib": _peak_mib()}


@lru_cache(maxsize=2)
def _world(name: str) -> World:
    return load_world(name)


def _settings(trial: TrialConfig) -> Row:
    return {"code": fingerprint(), "file": Path(trial.world).name} | {name: getattr(trial, name) for name in SETTINGS}


@lru_cache
def fingerprint() -> str:
    """Return a fingerprint of the code that decides a trial."""
    digest = hashlib.sha256()
    for package in (slam, explore, sim):
        for folder in package.__path__:
            for path in sorted(Path(folder).rglob("*.py")):
                digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _key(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(row[name] for name in KEYS)


def _read(path: Path) -> tuple[int, list[Row]]:
    """Return the length of the whole lines of a file, and their rows; a line without an end was cut short."""
    if not path.exists():
        return 0, []
    content = path.read_bytes()
    kept = content.rfind(b"\n") + 1
    try:
        rows = [json.loads(line) for line in content[:kept].splitlines()]
        for row in rows:
            _key(row)
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(f"expected rows of trials in {path}, found {error!r}: name another --out") from error
    return kept, rows


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
