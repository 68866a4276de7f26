"""How far each strategy drives: to the end, to 90 and 99 % of the contour and of the floor; paired by world and seed.

.venv/bin/python -m studies.exploration.strategies --seeds 20      # goes on where it was interrupted
.venv/bin/python -m studies.exploration.strategies --only-report
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float
from rich.console import Console
from rich.table import Table

from chainslam.experiments.scenario import Scenario, TrialConfig, build
from chainslam.experiments.scoring.maps.coverage import NEAR_M, NEAR_NOISY_M, Samples, alignment, coverage, sample
from chainslam.experiments.scoring.statistics import estimate, paired
from chainslam.experiments.scoring.truth import truth_of
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import default_mission, run_scenario
from chainslam.explore.step import Step
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.worlds import WORLDS
from chainslam.slam.geometry.poses import to_world

from ..runner.command import run_study
from ..runner.rows import Row, read
from ..runner.trials import scored

SHARES = (0.9, 0.99)
EVERY_STEPS = 10
"""Coverage along the path is scored this often: about a metre."""
SCORES = (
    *("status", "reason", "steps", "path_length_m", "coverage", "swept", "contours_closed", "contours_reachable"),
    *("collisions", "set_aside", "pose_rmse_m", "pose_anees", "map_anees", "duplicate_lines", "false_matches"),
)
KEYS = ("world", "strategy", "seed", "errorless")
LENGTHS = tuple(f"{what}_{share:g}_m" for what in ("contour", "floor") for share in SHARES)
BASELINE = "nearest-robot"


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


def known_by(trial: TrialConfig) -> Row:
    """Return what makes a trial this one and no other."""
    return {key: getattr(trial, key) for key in KEYS}


def one(config: TrialConfig) -> Row:
    """Run one trial and return its scores."""
    scenario = build(config)
    gauge = Gauge(scenario, sample(truth_of(scenario.world, config.robot)))
    result = run_scenario(scenario, gauge.watch, default_mission)
    summary = result.summary
    row = {key: summary.get(key) for key in SCORES} | {"set_aside": len(summary.get("set_aside", []))}
    if result.log is not None:
        lengths, shares = np.array(gauge.rows).T
        row |= {f"contour_{share:g}_m": length_to(share, lengths, shares) for share in SHARES}
        row |= {f"floor_{share:g}_m": summary[f"swept_{100 * share:g}_m"] for share in SHARES}
        row["step_ms_mean"] = summary["step_ms"]["mean"]
    return row


@dataclass(frozen=True)
class StrategyStudy:
    """Run every strategy in every world with every seed, a row at a time, and print the comparison."""

    worlds: tuple[str, ...] = tuple(WORLDS)
    """Bundled names or files."""
    strategies: tuple[str, ...] = tuple(STRATEGIES)
    """Names or schedules."""
    seeds: int = 20
    """Trials for each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    errorless: bool = False
    """Exact ranges and wheels."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/strategies.jsonl")
    """A line of JSON for each trial; what it holds of the same code already is not run again."""
    only_report: bool = False
    """Print the comparison of what is there."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials, seed by seed, so that what is there is balanced."""
        return [
            TrialConfig(world, strategy=strategy, seed=seed, errorless=self.errorless)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for world in self.worlds
            for strategy in self.strategies
        ]

    def run(self) -> None:
        """Run what is to be run and print the comparison; raises UsageError for bad names and another file."""
        rows = read(self.out, KEYS) if self.only_report else scored(self.trials(), self.out, known_by, one, self.jobs)
        print_report(rows, plain_console(width=160))


def ratio(rows: Sequence[Row], strategy: str, column: str) -> tuple[dict[str, float], float, float, float]:
    """Return the geometric mean of the ratios of lengths to the baseline's, in each world and over all pairs.

    Only seeds that both have reached count. Then the ends of the 95 % interval over all, by run, these worlds being
    given: NaN for fewer than five pairs.
    """
    logs = {
        name: {
            (row["world"], row["seed"]): float(np.log(row[column]))
            for row in rows
            if row["strategy"] == name and row.get(column) is not None
        }
        for name in (strategy, BASELINE)
    }
    pairs = paired(logs[strategy], logs[BASELINE])
    found = estimate(pairs)
    if found is None:
        return {}, np.nan, np.nan, np.nan
    worlds = dict.fromkeys(world for world, _ in pairs)
    means = {name: float(np.exp(np.mean([x for (world, _), x in pairs.items() if world == name]))) for name in worlds}
    ends = [np.nan if end is None else float(np.exp(end)) for end in (found.low, found.high)]
    return means, float(np.exp(found.mean)), ends[0], ends[1]


def print_report(rows: Sequence[Row], console: Console) -> None:
    """Print how each strategy ended, and its lengths against those of the baseline."""
    worlds, strategies = (list(dict.fromkeys(row[key] for row in rows)) for key in ("world", "strategy"))
    ends = Table(title="complete of trials; mean path m", title_justify="left")
    for name in ("strategy", *worlds, "coverage", "swept min", "collisions", "pose rmse m", "map ANEES"):
        ends.add_column(name, justify="left" if name == "strategy" else "right")
    for strategy in strategies:
        own = [row for row in rows if row["strategy"] == strategy]
        cells = []
        for world in worlds:
            here = [row for row in own if row["world"] == world]
            complete = sum(row["status"] == "complete" for row in here)
            cells.append(f"{complete}/{len(here)} {np.mean(values(here, 'path_length_m')):.0f}" if here else "-")
        coverage, swept, rmse, anees = (values(own, key) for key in ("coverage", "swept", "pose_rmse_m", "map_anees"))
        words = [f"{coverage.mean():.4f}", f"{swept.min():.4f}", f"{values(own, 'collisions').sum():.0f}"]
        ends.add_row(strategy, *cells, *words, f"{rmse.mean():.4f}", f"{anees.mean():.2f}" if len(anees) else "-")
    console.print(ends)
    for column in ("path_length_m", *LENGTHS):
        shown = Table(title=f"{column}, ratio to {BASELINE}", title_justify="left")
        for name in ("strategy", *worlds, "all", "95 % interval"):
            shown.add_column(name, justify="left" if name == "strategy" else "right")
        for strategy in strategies:
            means, mean, low, high = ratio(rows, strategy, column)
            by_world = [f"{means[world]:.2f}" if world in means else "-" for world in worlds]
            shown.add_row(strategy, *by_world, f"{mean:.2f}", f"{low:.2f} to {high:.2f}")
        console.print(shown)


def values(rows: Sequence[Row], key: str) -> Float[np.ndarray, " n"]:
    """Return a column of the rows that have it."""
    return np.array([row[key] for row in rows if row.get(key) is not None], dtype=np.float64)


if __name__ == "__main__":
    run_study(StrategyStudy)
