"""Why do intervals between corners fail more often in one run than in another? The truth replaces one stage at a time.

Each drive is replayed on its own scans: with the filter's own matches, with the true ones, and with true lines as well,
whose noise is drawn from the stated covariance.

.venv/bin/python -m studies.consistency.interval_causes --seeds 60     # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.artifacts.results import log_arrays
from chainslam.experiments.replays.replay import ReplayOptions, replay, run_of
from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from .intervals import LOW, scores

NAMES = ("world", "backend", "seed", "stage")
STAGES = {
    "own": ReplayOptions(),
    "true matches": ReplayOptions("true"),
    "true matches and lines": ReplayOptions("true", perfect_extraction=True),
}
"""What the truth takes the place of, by the name in the table."""


@dataclass(frozen=True)
class CauseStudy:
    """Explore a world with many seeds, replay each drive with parts of the truth, and print a row for each."""

    world: str = "paper-fig8"
    """A bundled world or a file."""
    backend: str = "invariant-ekf"
    """The estimator that drives and that is replayed."""
    seeds: int = 60
    """Drives."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/interval-causes.jsonl")
    """A line of JSON for each replay, as a drive's replays end. What it holds of the same code is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        check(TrialConfig(self.world, self.backend))
        tasks = [
            (seed, [(self.world, self.backend, seed, stage) for stage in STAGES])
            for seed in range(self.first_seed, self.first_seed + self.seeds)
        ]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_replays_of, self.world, self.backend), self.jobs))
        plain_console(width=120).print(table(rows))


def _replays_of(world: str, backend: str, seed: int) -> list[Row]:
    config = TrialConfig(world, backend, seed=seed)
    driven = run_trial(config)
    assert driven.log is not None
    arrays = {name: np.asarray(value) for name, value in log_arrays(driven, driven.log).items()}
    run = run_of(arrays, lambda: config)
    known = {"world": world, "backend": backend, "seed": seed}
    return [known | {"stage": stage} | scores(replay(run, backend, options)) for stage, options in STAGES.items()]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each stage: the share of intervals that hold, and how it scatters by run."""
    shown = Table(title="95 % intervals between corners, by what is true", title_justify="left")
    for column in ("the filter has", "runs", "held (95 %)", "mean z²", "sd by run", "sd expected", "too rare (2.5 %)"):
        shown.add_column(column, justify="left" if column == "the filter has" else "right")
    for stage in STAGES:
        own = [row for row in rows if row["stage"] == stage and row["pairs"]]
        held = np.array([row["held"] for row in own])
        shown.add_row(
            stage, str(len(own)), f"{held.mean():.3f}", f"{np.mean([row['mean_z2'] for row in own]):.2f}",
            f"{held.std():.3f}", f"{np.sqrt(np.mean([row['expected_sd'] ** 2 for row in own])):.3f}",
            f"{np.mean([row['rarer'] <= LOW for row in own]):.3f}",
        )  # fmt: skip
    return shown


if __name__ == "__main__":
    run_study(CauseStudy)
