"""How much floor is unseen at most, at 95 %: the bound of `unseen_floor.json`, and whether it holds in other plans.

.venv/bin/python -m studies.plans.unseen_floor --plans DIR              # by the stored bound
.venv/bin/python -m studies.plans.unseen_floor --plans DIR --calibrate  # store the bound of the even plans
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from msgspec.json import encode, format
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig, build
from chainslam.experiments.scoring.maps.swept import CELL_M, Floor, visible_floor
from chainslam.experiments.scoring.without_truth import unseen_floor
from chainslam.experiments.scoring.without_truth.unseen_floor import TABLE, Bound, calibrated, calibration, unseen_now
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import default_mission, run_scenario
from chainslam.experiments.usage import UsageError
from chainslam.explore.step import Step
from chainslam.slam.geometry.poses import compose

from ..runner.command import run_study
from ..runner.rows import Row, rows_of

NAMES = ("plan", "strategy", "seed")
EVERY = 10
"""Steps between two grids of a run."""
TIMES = 12
"""Grids of each run that count, evenly spaced from the first to the last."""
EDGES = np.array([0.0, 0.2, 0.5, 1.0])
"""Classes of reach in the table, the last without an end."""


@dataclass(frozen=True)
class UnseenFloorStudy:
    """Explore plans, hold unseen floor against the border of the grid, and print how often the bound holds."""

    plans: Path = Path("../shared/data/plans")
    """A folder of maps."""
    named: str = "lifull_*"
    """Which files of the folder, as the shell would write it."""
    count: int = 80
    """How many of them, in alphabetical order."""
    strategy: str = "nearest-robot"
    """The explorer."""
    seed: int = 1
    """Seed of each run."""
    max_steps: int = 3000
    """A run is stopped after this many scans."""
    calibrate: bool = False
    """Store the bound of every other plan, which is then tested on the rest."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/unseen_floor.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code is not run again."""

    def run(self) -> None:
        """Run the study and print its table; raises UsageError for a folder without plans."""
        plans = sorted(self.plans.glob(self.named))[: self.count]
        if not plans:
            raise UsageError(f"expected plan files in {self.plans}, found no {self.named}: check it")
        trials = [
            TrialConfig(str(plan), "invariant-ekf", self.strategy, seed=self.seed, max_steps=self.max_steps)
            for plan in plans
        ]
        tasks = [(each, [(Path(each.world).name, each.strategy, each.seed)]) for each in trials]
        rows = sorted(rows_of(self.out, NAMES, tasks, measured, self.jobs), key=lambda row: row["plan"])
        bound, held_out = calibration() if not self.calibrate else _bound(rows[::2]), rows
        if self.calibrate:
            place, held_out = Path(unseen_floor.__file__).with_name(TABLE), rows[1::2]
            place.write_bytes(format(encode(bound)) + b"\n")
        plain_console(width=120).print(table(held_out, bound))


def measured(trial: TrialConfig) -> Sequence[Row]:
    """Return the row of one run: the reach of its grids, and the share of unseen over seen floor by the truth."""
    scenario = build(trial)
    target, seen = visible_floor(scenario.world, trial.robot), Floor(scenario.world.floor)
    told: list[tuple[float, float, float]] = []

    def watch(step: Step) -> None:
        pose = compose(scenario.robot.record.poses_world[-1], trial.robot.true_scanner.pose_robot)
        seen.look(pose, step.scan.bearings_rad, step.scan.ranges_m, step.scan.range_max_m)
        if step.index % EVERY and step.outcome is None:
            return
        floor = unseen_now(step)
        if floor is None:
            return
        unseen_m2 = float(np.count_nonzero(target & ~seen.seen)) * CELL_M**2
        told.append((floor.frontier_m, floor.seen_m2, unseen_m2))

    run_scenario(scenario, watch, default_mission)
    kept = [told[k] for k in np.unique(np.linspace(0, len(told) - 1, TIMES).round().astype(int))]
    return [{"plan": Path(trial.world).name, "strategy": trial.strategy, "seed": trial.seed, "grids": kept}]


def _reaches(rows: Sequence[Row]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return reach and share of all grids."""
    frontier, area, unseen = np.array([grid for row in rows for grid in row["grids"]]).T
    return frontier / np.sqrt(area), unseen / area


def _bound(rows: Sequence[Row]) -> Bound:
    """Return the bound by some runs."""
    return calibrated(*_reaches(rows), len(rows))


def table(rows: Sequence[Row], bound: Bound) -> Table:
    """Return how often the bound holds, in each class of reach and in all."""
    reach, share = _reaches(rows)
    told = bound.share(reach)
    shown = Table(title=f"{len(rows)} runs, bound by {bound.runs} others", title_justify="left")
    for column in ("border over the root of seen floor", "grids", "holds", "unseen, median", "bound, median"):
        shown.add_column(column, justify="right")
    classes = np.searchsorted(EDGES, reach)
    parts = [(f"up to {edge:g}" if edge else "none", classes == k) for k, edge in enumerate(EDGES)]
    for words, here in (*parts, ("more", classes == len(EDGES)), ("all", classes >= 0)):
        if here.any():
            shares = np.mean(share[here] <= told[here]), np.median(share[here]), np.median(told[here])
            shown.add_row(words, str(here.sum()), *(f"{100 * each:.1f} %" for each in shares))
    return shown


if __name__ == "__main__":
    run_study(UnseenFloorStudy)
