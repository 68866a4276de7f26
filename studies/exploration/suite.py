"""Many trials on many worlds, and one table of them: what the figures of docs/contributing/results.md come from.

.venv/bin/python -m studies.exploration.suite --worlds paper-fig8 hall --seeds 20
.venv/bin/python -m studies.exploration.suite --plans DIR --errorless
"""

import sys
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from chainslam.experiments.scenario import P0, TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import WORLDS

from ..runner.command import run_study
from ..runner.trials import rows_of


@dataclass(frozen=True)
class Suite:
    """Run trials in several processes, print a row for each world and write a row for each trial."""

    worlds: tuple[str, ...] = tuple(WORLDS)
    """Bundled names or files."""
    plans: Path | None = None
    """A folder of maps: every file in it is a world, in place of `--worlds`."""
    named: str = "*"
    """Which files of the folder, as the shell would write it."""
    seeds: int = 1
    """Trials for each world."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    backend: str = "full-ekf"
    """The estimator."""
    strategy: str = "nearest-robot"
    """Which open end is visited next."""
    p0: P0 = "small"
    """Covariance of the start."""
    errorless: bool = False
    """Exact ranges and wheels."""
    max_steps: int = 100_000
    """A trial is stopped after this many scans."""
    max_path_m: float | None = None
    """A trial is stopped after this way, m."""
    slip: float = 1.0
    """The wheels slip so many times as much, and the robot states so. Each value needs a file of rows of its own."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/suite.jsonl")
    """A line of JSON for each trial, as it ends. What it holds of the same code already is not run again."""
    each: bool = False
    """Print one row for every trial that is not perfect, too."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials, world by world; raises UsageError for a folder without files."""
        names = self.worlds
        if self.plans is not None:
            names = tuple(sorted(str(path) for path in self.plans.glob(self.named) if path.is_file()))
            if not names:
                raise UsageError(f"expected a folder of maps, found no file {self.named} in {self.plans}: check it")
        robot = RobotConfig()
        wheels = replace(
            robot.wheels, slip=self.slip * robot.wheels.slip, lateral_slip=self.slip * robot.wheels.lateral_slip
        )
        one = partial(
            TrialConfig, backend=self.backend, strategy=self.strategy, p0=self.p0, errorless=self.errorless,
            max_steps=self.max_steps, max_path_m=self.max_path_m, robot=replace(robot, wheels=wheels),
        )  # fmt: skip
        return [one(name, seed=seed) for name in names for seed in range(self.first_seed, self.first_seed + self.seeds)]

    def run(self) -> None:
        """Run the suite and print its table."""
        console = plain_console(width=200 if not sys.stdout.isatty() else None)
        rows = list(rows_of(self.trials(), self.out, self.jobs))
        rows.sort(key=lambda row: (row["file"], row["seed"]))
        console.print(table(rows, by_world=self.plans is None))
        for row in rows:
            if row["status"] != "complete" or (self.each and row["coverage"] < 0.99):
                found = "" if row.get("coverage") is None else f", coverage {row['coverage']:.4f}"
                if row.get("map_began_step"):
                    found += f" ({row['coverage_own_frame']:.4f} laid over the truth by its path)"
                if (way := row.get("reachable_way")) is not None and way < 0.9:
                    found += f", {100 * way:.0f} % of its way open to it at the end"
                print(f"{row['file']} seed {row['seed']}: {row['status']}{found}: {row['reason']}")
        for key in sorted({key for row in rows for key in row if key.startswith("distance_error")}):
            worst = _values(rows, key)
            if len(worst) and self.plans is None:
                print(f"{key}: worst {100 * np.abs(worst).max():.1f} cm over {len(worst)} trials")
        print(f"rows in {self.out}")


def table(rows: list[dict[str, Any]], by_world: bool) -> Table:
    """Return a row for each world, or one for all trials together, and the total."""
    shown = Table(title=f"{len(rows)} trials", title_justify="left")
    shown.add_column("world", overflow="fold")
    columns = "complete|coverage min|mean|own frame|closed|false|duplicates|collisions|path m"
    columns += "|pose ANEES|in band|map ANEES|without: pose, map|wheels m|step ms|planning ms|growth|MiB"
    for column in columns.split("|"):
        shown.add_column(column, justify="right")
    if by_world:
        for world in dict.fromkeys(row["world"] for row in rows):
            shown.add_row(world, *_cells([row for row in rows if row["world"] == world]))
        shown.add_section()
    shown.add_row("all", *_cells(rows))
    return shown


def _cells(rows: list[dict[str, Any]]) -> list[str]:
    complete = sum(row["status"] == "complete" for row in rows)
    scored = [row for row in rows if row.get("coverage") is not None]
    closed = sum(row["contours_closed"] >= row["contours_reachable"] for row in scored)
    coverage = _values(scored, "coverage")
    return [
        f"{complete}/{len(rows)}",
        f"{coverage.min():.4f}" if len(coverage) else "-",
        _mean(scored, "coverage", 4),
        _mean(scored, "coverage_own_frame", 4),
        f"{closed}/{len(rows)}",
        *(str(sum(int(row[key]) for row in scored)) for key in ("false_matches", "duplicate_lines", "collisions")),
        _mean(scored, "path_length_m", 1),
        *(_mean(scored, key, 2) for key in ("pose_anees", "pose_nees_in_band", "map_anees")),
        _without(scored),
        _mean(scored, "odometry_max_m", 2),
        *(_mean(scored, key, 1) for key in ("step_ms_mean", "planning_ms_mean")),
        f"{_growth(scored):.2f}",
        f"{np.max(_values(scored, 'peak_mib'), initial=0.0):.0f}",
    ]


def _without(rows: list[dict[str, Any]]) -> str:
    """Return how many noisy trials have no pose or map ANEES: a covariance of theirs is not positive definite."""
    noisy = [row for row in rows if not row["errorless"]]
    return ", ".join(str(len(noisy) - len(_values(noisy, key))) for key in ("pose_anees", "map_anees"))


def _growth(rows: list[dict[str, Any]]) -> float:
    """Return how much longer a step takes in the last tenth of a run than in the fifth: the median over the runs."""
    along = [row["step_ms_along"] for row in rows if row.get("step_ms_along") and None not in row["step_ms_along"]]
    return float(np.median([parts[-1] / parts[4] for parts in along])) if along else np.nan


def _values(rows: list[dict[str, Any]], key: str) -> np.ndarray:
    return np.array([row[key] for row in rows if row.get(key) is not None], dtype=np.float64)


def _mean(rows: list[dict[str, Any]], key: str, digits: int) -> str:
    values = _values(rows, key)
    return f"{values.mean():.{digits}f}" if len(values) else "-"


if __name__ == "__main__":
    run_study(Suite)
