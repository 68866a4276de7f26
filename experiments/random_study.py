"""A robot in a thousand random buildings: a row for each, written as it comes; begun again, it goes on where it ended.

.venv/bin/python -m experiments.random_study --buildings 1000 --out results/random.jsonl
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console

from .scenario import TrialConfig, UsageError, check
from .suite import results, table


@dataclass(frozen=True)
class RandomStudy:
    """Explore `random:FIRST` and so on, one run each, and print what they come to and which were not clean."""

    buildings: int = 1000
    """How many."""
    first: int = 1
    """The first building's seed."""
    noise: bool = False
    """With noise; without this, exact ranges and wheels."""
    backend: str = "full-ekf"
    """The estimator."""
    strategy: str = "nearest-robot"
    """Which open end is visited next."""
    seed: int = 1
    """Decides all noise."""
    max_steps: int = 20_000
    """A run is stopped after this many scans."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/random.jsonl")
    """A line of JSON for each run. What it holds already is not run again: name another file for other code."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials in order."""
        worlds = (f"random:{self.first + k}" for k in range(self.buildings))
        return [
            TrialConfig(
                world, self.backend, self.strategy, self.seed, errorless=not self.noise, max_steps=self.max_steps
            )
            for world in worlds
        ]


def faults(row: dict[str, Any]) -> list[str]:
    """Return what was not clean about a run, in words; nothing for a clean one."""
    found = [] if row["status"] == "complete" else [f"{row['status']}: {row['reason']}"]
    if row.get("coverage") is None:
        return found
    found += [f"{row['collisions']} collisions"] if row["collisions"] else []
    found += [f"coverage {row['coverage']:.4f}"] if row["coverage"] < 0.98 else []
    if row["contours_closed"] < row["contours_reachable"]:
        found.append(f"{row['contours_closed']} of {row['contours_reachable']} contours closed")
    return found


def run(study: RandomStudy) -> Iterator[dict[str, Any]]:
    """Run what the study's file lacks, append each row as it comes, and yield all rows of this study.

    Raises UsageError for a file that holds something else.
    """
    trials = study.trials()
    check(trials[0])
    wanted = {_key(asdict(trial) | {"file": trial.world}): trial for trial in trials}
    kept, rows = _read(study.out)
    for row in rows:
        if wanted.pop(_key(row), None) is not None:
            yield row
    left = list(wanted.values())
    study.out.parent.mkdir(parents=True, exist_ok=True)
    with study.out.open("ab") as file:
        file.truncate(kept)
        for index, row in results(left, study.jobs):
            row |= {key: getattr(left[index], key) for key in ("backend", "strategy", "errorless")}
            file.write(json.dumps(row).encode() + b"\n")
            file.flush()
            yield row


def _key(row: dict[str, Any]) -> tuple[Any, ...]:
    """Return what makes a run this one and no other."""
    return tuple(row[name] for name in ("file", "seed", "backend", "strategy", "errorless"))


def _read(path: Path) -> tuple[int, list[dict[str, Any]]]:
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
        raise UsageError(f"expected rows of this study in {path}, found {error!r}: name another --out") from error
    return kept, rows


def main() -> int:
    """Run the study that the command line names and return the exit status: 1 where it was not clean."""
    study = tyro.cli(RandomStudy, prog="experiments.random_study")
    rows = []
    try:
        for row in run(study):
            rows.append(row)
            if sys.stderr.isatty():
                print(f"\r{len(rows)} of {study.buildings}", end="", file=sys.stderr, flush=True)
    except UsageError as error:
        print(f"random_study: {error}", file=sys.stderr)
        return 2
    for row in sorted(rows, key=lambda row: int(row["file"].partition(":")[2])):
        if faults(row):
            print(f"{row['file']}: {'; '.join(faults(row))}")
    Console(width=200 if not sys.stdout.isatty() else None).print(table(rows, by_world=False))
    paths = np.array([row["path_length_m"] for row in rows if row.get("path_length_m") is not None])
    clean = sum(not faults(row) for row in rows)
    print(f"{clean} of {len(rows)} clean, median path {np.median(paths):.0f} m; rows in {study.out}")
    complete = sum(row["status"] == "complete" for row in rows)
    return 0 if complete >= 0.99 * len(rows) and not any(row.get("collisions") for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
