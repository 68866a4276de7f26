"""How often the paper's method enters a duplicate wall (figure 9), beside today's mapper, driven by the same rules.

.venv/bin/python -m studies.consistency.paper_method      # goes on where it was interrupted
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from chainslam.experiments.artifacts.presets import METHODS as PRESETS
from chainslam.experiments.artifacts.settings import nested, over, trial_of
from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.terminal.console import plain_console

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.trials import one

PAPER = PRESETS["paper-method"]
GATE = "mission.mapper.matching.gate"
TODAY: dict[str, Any] = nested(PAPER.driving)
METHODS: dict[str, dict[str, Any]] = {
    "paper-method": PAPER.record,
    "block-ekf": TODAY | {"backend": "block-ekf"},
    "full-ekf": TODAY | {"backend": "full-ekf"},
    "paper-method, full-ekf": PAPER.record | {"backend": "full-ekf"},
    "paper-method, gate 0.9999": over(PAPER.record, nested([(GATE, 0.9999)])),
    "paper-method, full-ekf, gate 0.9999": over(PAPER.record, {"backend": "full-ekf"}, nested([(GATE, 0.9999)])),
}
"""What is compared: all go by walls and do not sweep, as the paper's robot did."""
NAMES = ("method", "world", "seed", "max_steps")
KEPT = (
    *("status", "reason", "steps", "path_length_m", "pose_anees", "pose_nees_in_band", "map_anees", "lines"),
    *("duplicate_lines", "false_matches", "merges", "coverage", "contours_closed", "processor_s"),
)


@dataclass(frozen=True)
class PaperMethodStudy:
    """Explore the world of figure 9 by the paper's method and by today's, and print a row for each."""

    world: str = "paper-fig9"
    """A bundled name or a file."""
    methods: tuple[str, ...] = tuple(METHODS)
    """Which of them."""
    seeds: int = 20
    """Trials of each method."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    max_steps: int = 600
    """A run is stopped after this many scans: half as many again as today's mapper takes."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/paper-method.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def trials(self) -> dict[tuple[str, int], TrialConfig]:
        """Return the trials by method and seed, seed by seed."""
        common = {"world": self.world, "max_steps": self.max_steps}
        return {
            (name, seed): trial_of(METHODS[name], common | {"seed": seed})
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for name in self.methods
        }

    def run(self) -> None:
        """Run what is to be run and print the comparison; raises UsageError for bad names and another file."""
        trials = self.trials()
        for trial in trials.values():
            check(trial)
        tasks = [(key, [(key[0], self.world, key[1], self.max_steps)]) for key in trials]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one_of, trials), self.jobs))
        plain_console(width=140).print(table(rows))


def _one_of(trials: Mapping[tuple[str, int], TrialConfig], key: tuple[str, int]) -> list[Row]:
    trial = trials[key]
    row = one(trial)
    named = dict(zip(NAMES, (key[0], trial.world, trial.seed, trial.max_steps), strict=True))
    return [named | {name: _short(row.get(name)) for name in KEPT}]


def _short(value: Any) -> Any:
    return float(f"{value:.4g}") if isinstance(value, float) else value


def table(rows: Sequence[Row]) -> Table:
    """Return, for each method, how its runs ended, how many duplicate walls, and how honest it is."""
    found = Table(
        *("method", "runs", "complete", "with a duplicate wall", "duplicates: median (range)", "merged"),
        *("false matches", "pose ANEES, median", "map ANEES, median", "m, median", "steps, median"),
    )
    for name in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == name]
        twice = _numbers(mine, "duplicate_lines")
        found.add_row(
            name,
            str(len(mine)),
            str(sum(row["status"] == "complete" for row in mine)),
            str(np.count_nonzero(twice)),
            f"{np.median(twice):g} ({twice.min():g} to {twice.max():g})",
            *(f"{_numbers(mine, key).sum():g}" for key in ("merges", "false_matches")),
            *(f"{np.median(_numbers(mine, key)):.3g}" for key in ("pose_anees", "map_anees", "path_length_m", "steps")),
        )
    return found


def _numbers(rows: Sequence[Row], key: str) -> np.ndarray:
    """Return a score of the runs that have it; NaN alone where none has."""
    return np.array([row[key] for row in rows if row[key] is not None] or [np.nan])


if __name__ == "__main__":
    run_study(PaperMethodStudy)
