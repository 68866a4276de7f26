"""A robot that begins in the blind, in the middle of courts: whether it ends before it has seen the floor.

.venv/bin/python -m studies.exploration.courts --buildings 10 --seeds 5 --out results/courts.jsonl
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console

from ..runner.command import run_study
from ..runner.trials import rows_of
from .court_worlds import court
from .suite import table

LEAST_SWEPT = 0.9
"""A run that ends `complete` has seen so much of the floor."""


@dataclass(frozen=True)
class CourtsStudy:
    """Explore drawn courts with noise, and print every run that failed, or ended before it had seen the floor."""

    buildings: int = 10
    """How many; the building of a number is always the same."""
    seeds: int = 5
    """Runs in each building; all buildings have one seed before any has the next."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    backends: tuple[str, ...] = ("invariant-ekf",)
    """The estimators."""
    max_steps: int = 3000
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/courts.jsonl")
    """A line of JSON for each run; the buildings are drawn beside it. What it holds of the same code already is not run
    again."""

    def trials(self) -> list[TrialConfig]:
        """Draw the buildings and return the trials in order."""
        self.out.parent.mkdir(parents=True, exist_ok=True)
        files = [self.out.parent / f"court-{k}.json" for k in range(1, self.buildings + 1)]
        for k, file in enumerate(files, start=1):
            file.write_text(json.dumps(court(k)))
        return [
            TrialConfig(str(file), backend, seed=seed, max_steps=self.max_steps)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for file in files
            for backend in self.backends
        ]

    def run(self) -> int:
        """Run the study and return the exit status: 1 where a run ended too soon."""
        rows = list(rows_of(self.trials(), self.out, self.jobs))
        rows.sort(key=lambda row: (row["file"], row["backend"], row["seed"]))
        plain_console(width=200 if not sys.stdout.isatty() else None).print(table(rows, by_world=True))
        for row in rows:
            if row["status"] == "failed" or is_premature(row):
                print(f"{row['world']} {row['backend']} seed {row['seed']}: {row['status']}, {row['reason']}")
        seen = sorted(row["swept"] for row in rows if row.get("swept") is not None)
        early = sum(map(is_premature, rows))
        print(f"{early} of {len(rows)} ended too soon; floor seen {seen[0]:.3f} to {seen[-1]:.3f}; rows in {self.out}")
        return 1 if early else 0


def is_premature(row: dict[str, Any]) -> bool:
    """Return whether a run said that it was complete and had not seen the floor."""
    return bool(row["status"] == "complete" and (row.get("swept") or 0.0) < LEAST_SWEPT)


if __name__ == "__main__":
    run_study(CourtsStudy)
