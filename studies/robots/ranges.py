"""Ranges with a bias or a scale: what is found of them, and how consistent a map is from which they are taken out.

.venv/bin/python -m studies.robots.ranges --seeds 2     # goes on where it was interrupted
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.table import Table

from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.terminal.console import plain_console
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.trials import one

HEAD = (
    "fault", "seed", "status", "bias found, mm", "scale found, %", "steps", "pose ANEES", "from the start", "map ANEES",
)  # fmt: skip
NAMES = ("case", "world", "backend", "seed", "max_steps", "calibrate")
CASES: Mapping[str, FaultsConfig] = {
    "none": FaultsConfig(),
    "+ 15 mm": FaultsConfig(range_bias_m=0.015),
    "+ 30 mm": FaultsConfig(range_bias_m=0.03),
    "+ 1 %": FaultsConfig(range_scale=1.01),
}


@dataclass(frozen=True)
class RangesStudy:
    """Explore a world with each fault, and print a row for each run."""

    world: str = "rooms"
    """A bundled world or a file."""
    backend: str = "full-ekf"
    """The estimator."""
    calibrate: bool = True
    """Whether what is found is taken out; else it is only told."""
    seeds: int = 2
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    max_steps: int = 1500
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/ranges.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        check(self.trial("none", 1))
        keys = [
            (case, self.world, self.backend, seed, self.max_steps, self.calibrate)
            for case in CASES
            for seed in range(self.first_seed, self.first_seed + self.seeds)
        ]
        tasks = [((key[0], key[3]), [key]) for key in keys]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one_of, self), self.jobs))
        plain_console(width=150).print(table(rows))

    def trial(self, case: str, seed: int) -> TrialConfig:
        """Return the trial of one fault."""
        robot = RobotConfig(lidar=LidarConfig(calibrate=self.calibrate), faults=CASES[case])
        return TrialConfig(self.world, self.backend, seed=seed, max_steps=self.max_steps, robot=robot)


def _one_of(study: RangesStudy, task: tuple[str, int]) -> list[Row]:
    case, seed = task
    return [one(study.trial(case, seed)) | {"case": case, "world": study.world, "calibrate": study.calibrate}]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each run."""
    shown = Table(title="Errors of ranges", title_justify="left")
    for column in HEAD:
        shown.add_column(column, justify="left" if column == HEAD[0] else "right")
    for row in rows:
        bias = f"{1e3 * row['range_bias_m']:.1f} ± {1e3 * row['range_bias_sigma_m']:.1f}"
        scale = f"{100.0 * (row['range_scale'] - 1.0):+.2f} ± {100.0 * row['range_scale_sigma']:.2f}"
        scores = (row[name] for name in ("pose_anees", "pose_anees_from_start", "map_anees"))
        told = ("-" if score is None else f"{score:.2f}" for score in scores)
        shown.add_row(row["case"], str(row["seed"]), row["status"], bias, scale, str(row["steps"]), *told)
    return shown


if __name__ == "__main__":
    run_study(RangesStudy)
