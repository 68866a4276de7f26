"""What it costs to go by sequences of walls, as the paper's robot did, in place of all the floor that was seen free.

.venv/bin/python -m studies.exploration.navigation --plans DIR      # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import get_args

import numpy as np
from rich.table import Table

from chainslam.experiments.artifacts.settings import NAVIGATION, nested, record_of, trial_of
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.explore.following.wall_following import Navigation
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.worlds import WORLDS

from ..runner.command import run_study
from ..runner.rows import Row, key_of
from ..runner.trials import KEYS, one, scored


@dataclass(frozen=True)
class NavigationStudy:
    """Explore each world with each navigation, strategy and seed, and each plan errorless, and print a row for each."""

    worlds: tuple[str, ...] = tuple(WORLDS)
    """Bundled names or files; none without a name behind the option."""
    strategies: tuple[str, ...] = tuple(STRATEGIES)
    """Names or schedules, for the worlds; plans are explored by the first."""
    seeds: int = 20
    """Trials for each world and strategy."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    errorless: bool = False
    """Exact ranges and wheels in the worlds, too."""
    plans: Path | None = None
    """A folder of plans."""
    named: str = "lifull_*.json"
    """Which files of the folder, as the shell would write it."""
    every: int = 1
    """Every so many of the plans."""
    max_steps: int = 5000
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/navigation.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials, seed by seed, each with every navigation; raises UsageError for a folder without plans."""
        found = [
            TrialConfig(world, strategy=strategy, seed=seed, errorless=self.errorless, max_steps=self.max_steps)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for world in self.worlds
            for strategy in self.strategies
        ]
        if self.plans is not None:
            names = sorted(str(path) for path in self.plans.glob(self.named) if path.is_file())
            if not names:
                raise UsageError(f"expected a folder of plans, found no file {self.named} in {self.plans}: check it")
            plain = TrialConfig("", strategy=self.strategies[0], errorless=True, max_steps=self.max_steps)
            found += [replace(plain, world=name) for name in names[:: self.every]]
        return [
            trial_of(record_of(trial), nested([(NAVIGATION, name)])) for trial in found for name in get_args(Navigation)
        ]

    def run(self) -> None:
        """Run what is to be run and print the comparison; raises UsageError for bad names and another file."""
        plain_console(width=140).print(table(scored(self.trials(), self.out, _known_by, one, self.jobs)))


def _known_by(trial: TrialConfig) -> Row:
    named = {name: getattr(trial, name) for name in KEYS if name != "file"}
    return named | {"file": Path(trial.world).name, "navigation": trial.mission.explorer.following.navigation}


def table(rows: Sequence[Row]) -> Table:
    """Return how the runs of each group of worlds ended with each navigation, and what they took.

    Metres, steps and time of planning are means over the runs that were completed with every navigation.
    """
    shown = Table(title=f"{len(rows)} runs", title_justify="left")
    for column in ("worlds", "navigation"):
        shown.add_column(column)
    for column in ("runs", "complete", "ends left", "coverage", "swept", "collisions", "m", "steps", "planning ms"):
        shown.add_column(column, justify="right")
    groups = dict.fromkeys(_group(row) for row in rows)
    for group in groups:
        own = [row for row in rows if _group(row) == group]
        sound = [_run(row) for row in own if row["status"] == "complete"]
        paired = {run for run in sound if sound.count(run) == len(get_args(Navigation))}
        for name in get_args(Navigation):
            here = [row for row in own if row["navigation"] == name]
            both = [row for row in here if _run(row) in paired]
            done = sum(row["status"] == "complete" for row in here)
            scores = [_mean(here, "set_aside", 2), _mean(here, "coverage", 4), _mean(here, "swept", 4)]
            scores.append(str(sum(row.get("collisions") or 0 for row in here)))
            scores += [_mean(both, "path_length_m", 1), _mean(both, "steps", 0), _mean(both, "planning_ms_mean", 1)]
            shown.add_row(group, name, str(len(here)), str(done), *scores)
    return shown


def _group(row: Row) -> str:
    return "plans, errorless" if row["file"].endswith(".json") else str(row["file"])


def _run(row: Row) -> tuple[object, ...]:
    return key_of(row, KEYS)


def _mean(rows: Sequence[Row], key: str, digits: int) -> str:
    found = [row[key] for row in rows if row.get(key) is not None]
    return f"{np.mean(found):.{digits}f}" if found else "-"


if __name__ == "__main__":
    run_study(NavigationStudy)
