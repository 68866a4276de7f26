"""Many trials on many worlds, and one table of them: what the figures of docs/results.md come from.

.venv/bin/python -m experiments.suite --worlds paper-fig8 hall --seeds 20
.venv/bin/python -m experiments.suite --plans DIR --errorless
"""

import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from sim.worlds import WORLDS, World

from .files import csv_bytes, write
from .scenario import P0, TrialConfig, UsageError, check, load_world
from .trial import run_trial

PLAIN = (str, int, float, bool)


@dataclass(frozen=True)
class Suite:
    """Run trials in several processes, print a row for each world and write a row for each trial."""

    worlds: tuple[str, ...] = tuple(WORLDS)
    """Bundled names or files."""
    plans: Path | None = None
    """A folder of maps: every file in it is a world, in place of `--worlds`."""
    seeds: int = 1
    """Trials for each world, with seeds 1 to this."""
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
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/suite.csv")
    """Where the table of all trials goes."""
    each: bool = False
    """Print one row for every trial that is not perfect, too."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials, world by world; raises UsageError for a folder without files."""
        names = self.worlds
        if self.plans is not None:
            names = tuple(sorted(str(path) for path in self.plans.glob("*") if path.is_file()))
            if not names:
                raise UsageError(f"expected a folder of maps, found no file in {self.plans}: check the path")
        return [
            TrialConfig(name, self.backend, self.strategy, seed, self.p0, self.errorless, self.max_steps)
            for name in names
            for seed in range(1, self.seeds + 1)
        ]


@lru_cache(maxsize=2)
def _world(name: str) -> World:
    return load_world(name)


def one(config: TrialConfig) -> dict[str, Any]:
    """Run one trial and return its row: the summary's plain values, distances and step times by name."""
    began = time.perf_counter()
    row: dict[str, Any] = {"file": Path(config.world).name, "seed": config.seed}
    try:
        summary = run_trial(config, world=_world(config.world)).summary
    except UsageError as error:
        return row | {"world": Path(config.world).stem, "status": "not loaded", "reason": str(error)}
    except Exception as error:  # a trial that cannot even be scored is a row of the table, not the end of it
        return row | {
            "world": Path(config.world).stem,
            "status": "failed",
            "reason": f"{type(error).__name__}: {error}",
        }
    row |= {key: value for key, value in summary.items() if value is None or isinstance(value, PLAIN)}
    row |= {f"step_ms_{key}": value for key, value in (summary["step_ms"] or {}).items()}
    for pair, distance in summary.get("distances", {}).items():
        mapped = distance["mapped_m"]
        row[f"distance_error_{pair}_m"] = None if mapped is None else mapped - distance["true_m"]
    row["set_aside"] = len(summary.get("set_aside", []))
    row["seconds"] = time.perf_counter() - began
    return row


def run(suite: Suite) -> list[dict[str, Any]]:
    """Run all trials and return their rows in the order of the trials, whatever order they end in."""
    trials = suite.trials()
    check(trials[0])
    rows: list[dict[str, Any]] = [{} for _ in trials]
    for done, (index, row) in enumerate(results(trials, suite.jobs), start=1):
        rows[index] = row
        if sys.stderr.isatty():
            print(f"\r{done} of {len(trials)}", end="", file=sys.stderr, flush=True)
    return rows


def results(trials: list[TrialConfig], jobs: int) -> Iterator[tuple[int, dict[str, Any]]]:
    """Run trials in several processes and yield index and row of each as it ends."""
    if jobs <= 1:
        yield from ((index, one(trial)) for index, trial in enumerate(trials))
        return
    with ProcessPoolExecutor(jobs) as pool:
        futures = {pool.submit(one, trial): index for index, trial in enumerate(trials)}
        for future in as_completed(futures):
            yield futures[future], future.result()


def table(rows: list[dict[str, Any]], by_world: bool) -> Table:
    """Return a row for each world, or one for all trials together, and the total."""
    shown = Table(title=f"{len(rows)} trials", title_justify="left")
    shown.add_column("world", overflow="fold")
    columns = "complete|coverage min|mean|closed|false|duplicates|collisions|path m"
    columns += "|pose ANEES|in band|map ANEES|wheels m|step ms"
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
        f"{closed}/{len(rows)}",
        *(str(sum(int(row[key]) for row in scored)) for key in ("false_matches", "duplicate_lines", "collisions")),
        _mean(scored, "path_length_m", 1),
        *(_mean(scored, key, 2) for key in ("pose_anees", "pose_nees_in_band", "map_anees", "odometry_max_m")),
        _mean(scored, "step_ms_mean", 1),
    ]


def _values(rows: list[dict[str, Any]], key: str) -> np.ndarray:
    return np.array([row[key] for row in rows if row.get(key) is not None], dtype=np.float64)


def _mean(rows: list[dict[str, Any]], key: str, digits: int) -> str:
    values = _values(rows, key)
    return f"{values.mean():.{digits}f}" if len(values) else "-"


def main() -> int:
    """Run the suite that the command line names and return the exit status."""
    suite = tyro.cli(Suite, prog="experiments.suite")
    console = Console(width=200 if not sys.stdout.isatty() else None)
    try:
        rows = run(suite)
    except UsageError as error:
        print(f"suite: {error}", file=sys.stderr)
        return 2
    header = list(dict.fromkeys(key for row in rows for key in row))
    suite.out.parent.mkdir(parents=True, exist_ok=True)
    write(suite.out, csv_bytes(header, [[row.get(key) for key in header] for row in rows]))
    console.print(table(rows, by_world=suite.plans is None))
    for row in rows:
        if row["status"] != "complete" or (suite.each and row["coverage"] < 0.99):
            print(f"{row['file']} seed {row['seed']}: {row['status']}: {row['reason']}")
    for key in (key for key in header if key.startswith("distance_error")):
        worst = _values(rows, key)
        if len(worst) and suite.plans is None:
            print(f"{key}: worst {100 * np.abs(worst).max():.1f} cm over {len(worst)} trials")
    print(f"rows in {suite.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
