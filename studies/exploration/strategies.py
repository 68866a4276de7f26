"""How far each strategy drives: to the end, to 90 and 99 % of the contour and of the floor; paired by world and seed.

.venv/bin/python -m studies.exploration.strategies --seeds 20      # goes on where it was interrupted
.venv/bin/python -m studies.exploration.strategies --only-report
"""

import csv
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tyro
from jaxtyping import Float
from rich.console import Console
from rich.table import Table

from experiments.scenario import Scenario, TrialConfig, build, check
from experiments.scoring.coverage import NEAR_M, NEAR_NOISY_M, Samples, alignment, coverage, sample
from experiments.scoring.records import Log
from experiments.scoring.swept import Floor, visible_floor
from experiments.scoring.truth import truth_of
from experiments.terminal.console import plain_console
from experiments.trial import default_mission, run_scenario
from explore.step import Step
from explore.strategies import STRATEGIES
from sim.worlds import WORLDS
from slam.geometry.poses import to_world

SHARES = (0.9, 0.99)
EVERY_STEPS = 10
"""Coverage along the path is scored this often: about a metre."""
SCORES = (
    *("status", "reason", "steps", "path_length_m", "coverage", "swept", "contours_closed", "contours_reachable"),
    *("collisions", "set_aside", "pose_rmse_m", "pose_anees", "map_anees", "duplicate_lines", "false_matches"),
)
KEYS = ("world", "strategy", "seed", "errorless")
LENGTHS = tuple(f"{what}_{share:g}_m" for what in ("contour", "floor") for share in SHARES)
COLUMNS = (*KEYS, *SCORES, *LENGTHS, "step_ms_mean")
BASELINE = "nearest-robot"
FEWEST_PAIRS = 5


@dataclass
class Gauge:
    """Scores the map while it grows, against the truth."""

    scenario: Scenario
    samples: Samples
    rows: list[tuple[float, float]] = field(default_factory=list)
    """(path length m, covered share of the reachable contour)."""

    def watch(self, step: Step) -> None:
        """Score every tenth step, and the last."""
        if step.index % EVERY_STEPS and step.ended is None:
            return
        near = NEAR_M if self.scenario.config.errorless else NEAR_NOISY_M
        to_true = alignment(self.scenario.start_estimate, self.scenario.robot.record.poses_world[0])
        ends = to_world(step.map.ends_world[~step.map.tentative], to_true)
        self.rows.append((step.path_length_m, coverage(self.samples, ends, near)))


def length_to(share: float, lengths: Float[np.ndarray, " s"], shares: Float[np.ndarray, " s"]) -> float | None:
    """Return the path length at which a share was first reached, m; None if it never was."""
    reached = np.flatnonzero(shares >= share)
    return float(lengths[reached[0]]) if len(reached) else None


def floor_shares(scenario: Scenario, log: Log) -> Float[np.ndarray, " s"]:
    """Return, for each step, the share of the visible floor that was seen up to then, from the true poses."""
    target = visible_floor(scenario.world, scenario.config.robot)
    floor, shares = Floor(scenario.world.free), []
    for pose, ranges in zip(log.true_world, log.ranges_m, strict=True):
        floor.look(pose, log.bearings_rad, ranges, log.range_max_m)
        shares.append(np.count_nonzero(floor.seen & target))
    return np.array(shares) / max(int(np.count_nonzero(target)), 1)


def one(config: TrialConfig) -> dict[str, Any]:
    """Run one trial and return its row."""
    scenario = build(config)
    gauge = Gauge(scenario, sample(truth_of(scenario.world, config.robot)))
    result = run_scenario(scenario, gauge.watch, default_mission)
    summary = result.summary
    row = {"world": config.world, "strategy": config.strategy, "seed": config.seed, "errorless": config.errorless}
    row |= {key: summary.get(key) for key in SCORES} | {"set_aside": len(summary.get("set_aside", []))}
    if result.log is not None:
        lengths, shares = np.array(gauge.rows).T
        swept = floor_shares(scenario, result.log)
        row |= {f"contour_{share:g}_m": length_to(share, lengths, shares) for share in SHARES}
        row |= {f"floor_{share:g}_m": length_to(share, result.log.path_length_m, swept) for share in SHARES}
        row["step_ms_mean"] = summary["step_ms"]["mean"]
    return row


@dataclass(frozen=True)
class Study:
    """Run every strategy in every world with every seed, a row at a time, and print the comparison."""

    worlds: tuple[str, ...] = tuple(WORLDS)
    """Bundled names or files."""
    strategies: tuple[str, ...] = tuple(STRATEGIES)
    """Names or schedules."""
    seeds: int = 20
    """Trials for each, with seeds 1 to this."""
    errorless: bool = False
    """Exact ranges and wheels."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/strategies.csv")
    """The table of all trials; rows that are in it already are not run again."""
    only_report: bool = False
    """Print the comparison of what is there."""

    def trials(self) -> Iterator[TrialConfig]:
        """Return the trials that are still to be run, seed by seed, so that what is there is balanced."""
        done = {(row["world"], row["strategy"], int(row["seed"]), row["errorless"]) for row in rows_in(self.out)}
        for seed in range(1, self.seeds + 1):
            for world in self.worlds:
                for strategy in self.strategies:
                    if (world, strategy, seed, str(self.errorless)) not in done:
                        yield TrialConfig(world, strategy=strategy, seed=seed, errorless=self.errorless)

    def run(self) -> None:
        """Run what is to be run and print the comparison."""
        trials = [] if self.only_report else list(self.trials())
        for trial in trials:
            check(trial)
        self.out.parent.mkdir(parents=True, exist_ok=True)
        for row in self._rows(trials):
            append(self.out, row)
        print_report(pd.read_csv(self.out), plain_console(width=160))

    def _rows(self, trials: list[TrialConfig]) -> Iterator[dict[str, Any]]:
        if self.jobs <= 1:
            yield from map(one, trials)
            return
        with ProcessPoolExecutor(self.jobs) as pool:
            for future in as_completed(pool.submit(one, trial) for trial in trials):
                yield future.result()


def rows_in(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table as text; none where there is no table yet."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def append(path: Path, row: dict[str, Any]) -> None:
    """Add one row to a table, with its header if it is the first."""
    is_new = not path.exists()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if is_new:
            writer.writeheader()
        writer.writerow(row)


def ratio(
    table: pd.DataFrame, strategy: str, column: str, draws: int = 2000
) -> tuple[dict[str, float], float, float, float]:
    """Return the ratio of mean lengths to the baseline's in each world, and their geometric mean with its interval.

    Only seeds that both have reached count. The 95 % interval resamples the pairs within each world; the worlds stay.
    It is NaN where a world has fewer than five pairs.
    """
    pairs = table[table.strategy == strategy].merge(table[table.strategy == BASELINE], on=["world", "seed"])
    pairs = pairs.dropna(subset=[f"{column}_x", f"{column}_y"])
    rng, means, drawn, fewest = np.random.default_rng(0), {}, [], FEWEST_PAIRS
    for world, rows in pairs.groupby("world", sort=False):
        values = rows[[f"{column}_x", f"{column}_y"]].to_numpy(float)
        fewest = min(fewest, len(values))
        means[str(world)] = float(values[:, 0].mean() / values[:, 1].mean())
        picks = values[rng.integers(0, len(values), (draws, len(values)))].mean(axis=1)
        drawn.append(np.log(picks[:, 0] / picks[:, 1]))
    if not means:
        return {}, np.nan, np.nan, np.nan
    if fewest < FEWEST_PAIRS:
        return means, float(np.exp(np.mean(np.log(list(means.values()))))), np.nan, np.nan
    low, high = np.exp(np.quantile(np.mean(drawn, axis=0), [0.025, 0.975]))
    return means, float(np.exp(np.mean(np.log(list(means.values()))))), float(low), float(high)


def print_report(table: pd.DataFrame, console: Console) -> None:
    """Print how each strategy ended, and its lengths against those of the baseline."""
    worlds = list(dict.fromkeys(table.world))
    ends = Table(title="complete of trials; mean path m", title_justify="left")
    for name in ("strategy", *worlds, "coverage", "swept min", "collisions", "pose rmse m", "map ANEES"):
        ends.add_column(name, justify="left" if name == "strategy" else "right")
    for strategy, rows in table.groupby("strategy", sort=False):
        cells = []
        for world in worlds:
            here = rows[rows.world == world]
            cells.append(f"{(here.status == 'complete').sum()}/{len(here)} {here.path_length_m.mean():.0f}")
        scores = (rows.coverage.mean(), rows.swept.min(), rows.collisions.sum(), rows.pose_rmse_m.mean())
        words = [f"{scores[0]:.4f}", f"{scores[1]:.4f}", f"{scores[2]:.0f}", f"{scores[3]:.4f}"]
        ends.add_row(str(strategy), *cells, *words, f"{rows.map_anees.mean():.2f}")
    console.print(ends)
    for column in ("path_length_m", *LENGTHS):
        shown = Table(title=f"{column}, ratio to {BASELINE}", title_justify="left")
        for name in ("strategy", *worlds, "all", "95 % interval"):
            shown.add_column(name, justify="left" if name == "strategy" else "right")
        for strategy in dict.fromkeys(table.strategy):
            means, mean, low, high = ratio(table, strategy, column)
            by_world = [f"{means[world]:.2f}" if world in means else "-" for world in worlds]
            shown.add_row(strategy, *by_world, f"{mean:.2f}", f"{low:.2f} to {high:.2f}")
        console.print(shown)


if __name__ == "__main__":
    tyro.cli(Study).run()
