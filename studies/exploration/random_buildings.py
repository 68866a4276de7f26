"""A robot in a thousand random buildings: a row for each, written as it comes; begun again, it goes on where it ended.

.venv/bin/python -m studies.exploration.random_buildings --buildings 1000 --out results/random.jsonl
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console

from ..runner.command import run_study
from ..runner.trials import rows_of
from .suite import table


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
    """A line of JSON for each run. What it holds of the same code already is not run again."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials in order."""
        worlds = (f"random:{self.first + k}" for k in range(self.buildings))
        return [
            TrialConfig(
                world, self.backend, self.strategy, self.seed, errorless=not self.noise, max_steps=self.max_steps
            )
            for world in worlds
        ]

    def run(self) -> int:
        """Run the study and return the exit status: 1 where it was not clean."""
        rows = list(rows_of(self.trials(), self.out, self.jobs))
        for row in sorted(rows, key=lambda row: int(row["file"].partition(":")[2])):
            if faults(row):
                print(f"{row['file']}: {'; '.join(faults(row))}")
        plain_console(width=200 if not sys.stdout.isatty() else None).print(table(rows, by_world=False))
        paths = np.array([row["path_length_m"] for row in rows if row.get("path_length_m") is not None])
        clean = sum(not faults(row) for row in rows)
        print(f"{clean} of {len(rows)} clean, median path {np.median(paths):.0f} m; rows in {self.out}")
        complete = sum(row["status"] == "complete" for row in rows)
        return 0 if complete >= 0.99 * len(rows) and not any(row.get("collisions") for row in rows) else 1


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


if __name__ == "__main__":
    run_study(RandomStudy)
