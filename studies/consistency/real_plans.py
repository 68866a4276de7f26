"""The paper's question in real plans: which back ends know how wrong they are, and where the excess comes from.

Each plan is explored once; the drive's own scans are replayed through every back end, with the matches of its own
estimate and with the true ones, and with true lines in place of those extracted.

.venv/bin/python -m studies.consistency.real_plans --plans ../shared/data/plans --every 4   # goes on where interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.artifacts.results import log_arrays
from chainslam.experiments.campaign.scores.innovation import InnovationEar
from chainslam.experiments.replays.replay import ReplayOptions, replay, run_of
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError, choose
from chainslam.slam.backends import BACKENDS

from ..results.figures import innovations
from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.scores import precision
from .intervals import scores

NAMES = ("world", "seed", "backend", "stage")
STAGES = {
    "own": ReplayOptions(),
    "true matches": ReplayOptions("true"),
    "true lines": ReplayOptions(perfect_extraction=True),
    "true matches and lines": ReplayOptions("true", perfect_extraction=True),
}
"""What the truth takes the place of, by the name in the table."""
ONLINE = tuple(name for name in BACKENDS if name != "graph-batch")
"""Until the end `graph-batch` is `graph`."""
KEPT = (
    *("pose_anees_from_start", "nis", "nis_in_band"),
    "pose_anees",
    "pose_nees_in_band",
    "map_anees",
    "map_frame_anees",
    "map_frame_m",
    "map_frame_rad",
    "pose_rmse_m",
)
COUNTED = (
    *("false_matches", "false_matches_few_beams", "duplicate_lines", "false_merges"),
    *("merges", "lines", "lines_crooked", "coverage"),
)


@dataclass(frozen=True)
class RealPlans:
    """Explore real plans, replay each drive through all back ends, and print two tables."""

    plans: Path
    """Folder of plan files."""
    every: int = 4
    """Every so many plans by name."""
    pattern: str = "lifull_*.json"
    """Which files of the folder."""
    driver: str = "invariant-ekf"
    """The estimator that drives."""
    backends: tuple[str, ...] = ONLINE
    """Those that are replayed, with their own matches and with the true ones."""
    stages: tuple[str, ...] = tuple(STAGES)
    """What the truth takes the place of; of other back ends than the driver the first two alone."""
    seed: int = 1
    """Of the noise."""
    max_steps: int = 3000
    """A drive stops here."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/real-plans.jsonl")
    """A line of JSON for each replay, as a plan's replays end. What it holds of the same code is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the tables; raises UsageError."""
        plans = sorted(self.plans.glob(self.pattern))[:: self.every]
        if not plans:
            raise UsageError(f"expected plan files in {self.plans}, found no {self.pattern}")
        for name in self.stages:
            choose("stage", name, STAGES)
        cells = [cell for cell in cells_of(self.backends, self.driver) if cell[1] in self.stages]
        tasks = [(plan, [(plan.stem, self.seed, *cell) for cell in cells]) for plan in plans]
        perform = partial(_replays_of, self.driver, self.seed, self.max_steps, cells)
        rows = list(rows_of(self.out, NAMES, tasks, perform, self.jobs))
        for each in (table_of_backends(rows), table_of_stages(rows, self.driver)):
            plain_console(width=150).print(each)


def cells_of(backends: Sequence[str], driver: str) -> tuple[tuple[str, str], ...]:
    """Return the pairs (back end, stage) of one drive: all stages of the driver, own and true matches of the others."""
    return tuple(
        (backend, stage) for backend in backends for stage in STAGES if backend == driver or "lines" not in stage
    )


def _replays_of(driver: str, seed: int, max_steps: int, cells: Sequence[tuple[str, str]], plan: Path) -> list[Row]:
    config = TrialConfig(str(plan), driver, seed=seed, max_steps=max_steps)
    driven = run_trial(config)
    assert driven.log is not None
    arrays = {name: np.asarray(value) for name, value in log_arrays(driven, driven.log).items()}
    run = run_of(arrays, lambda: config)
    known = {"world": plan.stem, "seed": seed, "status": driven.summary["status"], "steps": len(driven.log)}
    rows = []
    for backend, stage in cells:
        ear = InnovationEar(config.mission.mapper.walls.reliability)
        hears = STAGES[stage].association == "true"
        result = replay(run, backend, STAGES[stage], around=ear.around if hears else lambda matcher: matcher)
        told = {key: result.summary.get(key) for key in (*KEPT, *COUNTED)}
        if hears:
            # On true matches before any gate, scan by scan: a gate cuts off the very tail that tells.
            told |= {"nis": ear.mean(), "nis_in_band": ear.in_band()}
        log = result.log
        assert log is not None
        rms, sigma = precision(log.from_start_world, log.from_start_cov, log.true_world)
        told |= {"rms_from_start_m": rms, "sigma_from_start_m": sigma}
        of_corners = scores(result) if result.joint is not None else {"pairs": 0}
        corners = {key: of_corners.get(key) for key in ("pairs", "held", "mean_z2")}
        rows.append(known | {"backend": backend, "stage": stage} | told | corners)
    return rows


def table_of_backends(rows: Sequence[Row]) -> Table:
    """Return a row for each back end and kind of matching."""
    shown = Table(title="Real plans: one drive each, replayed through every back end", title_justify="left")
    for column in ("back end", "matches", "plans", "pose ANEES", "median", "map ANEES", "median", "95 % intervals held",
                   "pose rms, mm", "false matches", "duplicates", "from the start", "median", "NIS"):  # fmt: skip
        shown.add_column(column, justify="left" if column in ("back end", "matches") else "right")
    for backend in dict.fromkeys(row["backend"] for row in rows):
        for stage in ("own", "true matches"):
            own = [row for row in rows if (row["backend"], row["stage"]) == (backend, stage)]
            if own:
                shown.add_row(backend, stage, str(len(own)), *_figures(own))
    return shown


def table_of_stages(rows: Sequence[Row], driver: str) -> Table:
    """Return a row for each stage that the truth took the place of."""
    shown = Table(title=f"Where the excess comes from ({driver})", title_justify="left")
    for column in ("true is", "plans", "pose ANEES", "median", "map ANEES", "median", "95 % intervals held",
                   "pose rms, mm", "false matches", "duplicates", "from the start", "median", "NIS"):  # fmt: skip
        shown.add_column(column, justify="left" if column == "true is" else "right")
    for stage in STAGES:
        own = [row for row in rows if (row["backend"], row["stage"]) == (driver, stage)]
        if own:
            shown.add_row("nothing" if stage == "own" else stage, str(len(own)), *_figures(own))
    return shown


def _figures(rows: Sequence[Row]) -> list[str]:
    cells = []
    for key in ("pose_anees", "map_anees"):
        values = [row[key] for row in rows if row[key] is not None]
        cells += [f"{np.mean(values):.2f}", f"{np.median(values):.2f}"] if values else ["-", "-"]
    held, pairs = (np.array([row[key] or 0.0 for row in rows]) for key in ("held", "pairs"))
    cells.append(f"{np.average(held, weights=pairs):.3f}" if pairs.any() else "-")
    cells.append(f"{1e3 * np.median([row['pose_rmse_m'] for row in rows]):.1f}")
    cells += [f"{np.mean([row[key] for row in rows]):.2f}" for key in ("false_matches", "duplicate_lines")]
    relative = [row["pose_anees_from_start"] for row in rows if row.get("pose_anees_from_start") is not None]
    cells += [f"{np.mean(relative):.2f}", f"{np.median(relative):.2f}"] if relative else ["-", "-"]
    return [*cells, innovations(rows)]


if __name__ == "__main__":
    run_study(RealPlans)
