"""Does odometry from the scans make an estimate overconfident? Worlds explored by the wheels and by the scans.

Matching uses each scan to tell the motion, and the map uses it again. Both drive themselves, so their ways differ.

.venv/bin/python -m studies.logs.matched_drives --seeds 20     # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.scenario import OdometrySource, TrialConfig, check
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.tables import headed

ROWS = Path("studies/logs/matched_drives.jsonl")
NAMES = ("world", "backend", "odometry", "seed")
SOURCES: tuple[OdometrySource, ...] = ("wheels", "scans")
SCORES = (
    *("status", "reason", "steps", "path_length_m", "coverage", "contours_closed", "contours_reachable", "collisions"),
    *("pose_anees", "pose_nees_in_band", "pose_rmse_m", "heading_rmse_rad", "odometry_end_m", "map_anees"),
    *("false_matches", "duplicate_lines"),
)
HEAD = (
    "world", "back end", "odometry", "runs", "complete", "pose ANEES, mean", "standard error", "median",
    "steps in the 95 % band", "pose error, m rms", "map ANEES, median", "false matches", "contours", "path, m",
)  # fmt: skip


@dataclass(frozen=True)
class MatchedStudy:
    """Explore each world with many seeds and both kinds of odometry, and print a row for each kind."""

    worlds: tuple[str, ...] = ("paper-fig8", "rooms")
    """Bundled worlds or files."""
    backends: tuple[str, ...] = ("invariant-ekf",)
    """The estimators; each drives."""
    seeds: int = 20
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    jobs: int = 1
    """Number of processes."""
    out: Path = ROWS
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        keys = [
            (world, backend, odometry, seed)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for world in self.worlds
            for backend in self.backends
            for odometry in SOURCES
        ]
        for key in keys:
            check(_trial(*key))
        tasks = [(key, [key]) for key in keys]
        plain_console(width=170).print(table(list(rows_of(self.out, NAMES, tasks, _one, self.jobs))))


def _trial(world: str, backend: str, odometry: OdometrySource, seed: int) -> TrialConfig:
    return TrialConfig(world, backend, seed=seed, odometry=odometry)


def _one(key: tuple[str, str, OdometrySource, int]) -> list[Row]:
    summary = run_trial(_trial(*key)).summary
    return [dict(zip(NAMES, key, strict=True)) | {name: summary[name] for name in SCORES}]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each world, back end and kind of odometry."""
    shown = headed("Worlds explored by wheels and by scans", HEAD, 3)
    for kind in sorted({tuple(row[name] for name in NAMES[:3]) for row in rows}):
        of = [row for row in rows if tuple(row[name] for name in NAMES[:3]) == kind]
        shown.add_row(*kind, *_cells(of))
    return shown


def _cells(rows: Sequence[Row]) -> list[str]:
    anees = np.array([row["pose_anees"] for row in rows])
    closed, reachable = (sum(row[f"contours_{kind}"] for row in rows) for kind in ("closed", "reachable"))
    complete = sum(row["status"] == "complete" for row in rows)
    return [
        str(len(rows)), str(complete), f"{anees.mean():.2f}",
        f"{anees.std(ddof=1) / np.sqrt(len(anees)):.2f}" if len(anees) > 1 else "-", f"{np.median(anees):.2f}",
        f"{np.mean([row['pose_nees_in_band'] for row in rows]):.2f}",
        f"{np.sqrt(np.mean([row['pose_rmse_m'] ** 2 for row in rows])):.3f}",
        f"{np.median([row['map_anees'] for row in rows]):.2f}",
        str(sum(row["false_matches"] for row in rows)), f"{closed} of {reachable}",
        f"{np.mean([row['path_length_m'] for row in rows]):.0f}",
    ]  # fmt: skip


if __name__ == "__main__":
    run_study(MatchedStudy)
