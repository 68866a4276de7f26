"""Every back end in every school: whether any run ends by an exception, and which of two loses fewer maps.

.venv/bin/python -m studies.exploration.schools --plans DIR --out results/schools-short.jsonl
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from scipy.stats import binomtest

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.slam.backends import BACKENDS

from ..results.plans import LOST
from ..runner.command import run_study
from ..runner.trials import rows_of


@dataclass(frozen=True)
class SchoolsStudy:
    """Explore the first steps of each plan with each back end, with noise, and print a row for each back end."""

    plans: Path
    """A folder of plans."""
    named: str = "cml_*.json"
    """Which files of the folder, as the shell would write it."""
    backends: tuple[str, ...] = tuple(reversed(BACKENDS))
    """The estimators, one after the other."""
    seeds: tuple[int, ...] = (1,)
    """Each decides all noise of a run of every plan."""
    max_steps: int = 1500
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    any_code: bool = False
    """Whether rows of other versions of the code count, too."""
    out: Path = Path("results/schools-short.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials, those of a plan beside each other; raises UsageError for a folder without plans."""
        names = sorted(str(path) for path in self.plans.glob(self.named) if path.is_file())
        if not names:
            raise UsageError(f"expected a folder of plans, found no file {self.named} in {self.plans}: check it")
        return [
            TrialConfig(name, backend, seed=seed, max_steps=self.max_steps)
            for seed in self.seeds
            for name in names
            for backend in self.backends
        ]

    def run(self) -> int:
        """Run the study and return the exit status: 1 where an exception ended a run."""
        rows = list(rows_of(self.trials(), self.out, self.jobs, self.any_code))
        plain_console(width=200 if not sys.stdout.isatty() else None).print(table(rows, self.backends))
        for one, other in combinations(self.backends, 2):
            pairs, only_one, only_other, p = lost_in_pairs(rows, one, other)
            print(f"{pairs} pairs: only {one} lost its map in {only_one}, only {other} in {only_other}; p = {p:.3g}")
        for row in rows:
            if row["status"] not in ("complete", "stopped"):
                print(f"{row['file']} {row['backend']}: {row['status']} at step {row.get('steps')}: {row['reason']}")
        return 1 if any(row.get("raised") for row in rows) else 0


def table(rows: Sequence[dict[str, Any]], backends: Sequence[str]) -> Table:
    """Return a row for each back end: runs, those that an exception ended, other failures, recoveries, its step."""
    shown = Table(title=f"{len(rows)} runs", title_justify="left")
    shown.add_column("back end")
    for column in ["runs", "exceptions", "failed otherwise", "recoveries", "runs with any", "steps", "step ms"]:
        shown.add_column(column, justify="right")
    for backend in backends:
        own = [row for row in rows if row["backend"] == backend]
        if own:
            raised = [row for row in own if row.get("raised")]
            recoveries = [row.get("recoveries") or 0 for row in own]
            steps = [row.get("steps") or 0 for row in own]
            times = [row["step_ms_mean"] for row in own if row.get("step_ms_mean") is not None]
            failed = sum(row["status"] not in ("complete", "stopped") for row in own) - len(raised)
            counts = (len(own), len(raised), failed, sum(recoveries), np.count_nonzero(recoveries), sum(steps))
            shown.add_row(backend, *map(str, counts), f"{np.mean(times):.1f}" if times else "-")
    return shown


def lost_in_pairs(rows: Sequence[dict[str, Any]], one: str, other: str) -> tuple[int, int, int, float]:
    """Return the number of pairs of runs, in how many only the one or the other lost its map, and how likely that is.

    A pair has one plan and seed. The likelihood is that of the two-sided sign test: of a difference as large or larger
    if both lose their maps alike.
    """
    lost = {
        backend: {(row["file"], row["seed"]): row["pose_anees"] > LOST for row in rows if row["backend"] == backend
                  and row.get("pose_anees") is not None}
        for backend in (one, other)
    }  # fmt: skip
    both = lost[one].keys() & lost[other].keys()
    only_one = sum(lost[one][pair] and not lost[other][pair] for pair in both)
    only_other = sum(lost[other][pair] and not lost[one][pair] for pair in both)
    differ = only_one + only_other
    p = float(binomtest(only_one, differ).pvalue) if differ else 1.0
    return len(both), only_one, only_other, p


if __name__ == "__main__":
    run_study(SchoolsStudy)
