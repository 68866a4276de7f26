"""Other bodies, and a scanner ahead of the axle: whether exploration still ends, without a collision.

.venv/bin/python -m studies.robots.bodies --plans ../shared/data/plans   # goes on where it was interrupted
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig, check, load_world
from chainslam.experiments.terminal.console import plain_console
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World
from chainslam.slam.robot import ScannerSpec

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.trials import one

HEAD = (
    "robot", "world", "complete", "coverage, least", "contours", "steps, median", "steps over the paper's robot's",
    "pose ANEES, median", "map ANEES, median", "collisions",
)  # fmt: skip
NAMES = ("case", "world", "backend", "seed", "max_steps")
PAPER = "radius 0.2 m"
CASES: Mapping[str, RobotConfig] = {
    PAPER: RobotConfig(),
    **{f"radius {radius:g} m": RobotConfig(radius_m=radius) for radius in (0.1, 0.15, 0.25, 0.3, 0.35, 0.4)},
    "scanner 0.12 m ahead": RobotConfig(scanner=ScannerSpec(0.12)),
    "scanner 0.1 m behind, 0.05 m left, turned": RobotConfig(scanner=ScannerSpec(-0.1, 0.05, 0.5 * np.pi)),
}
SPARE_M, FITS_SHARE = 0.0125, 0.9
"""A building's doors fit a body that, with so much room beside it, covers so much of what the paper's robot does."""


@dataclass(frozen=True)
class BodiesStudy:
    """Explore buildings whose doors fit with each robot, and print a row for each."""

    plans: Path | None = None
    """The folder of the apartments; without it, bundled worlds only."""
    worlds: tuple[str, ...] = ("rooms",)
    """Bundled worlds."""
    apartments: tuple[str, ...] = ("lifull_007139d36e1e_0002", "lifull_015a213e527d_0003")
    """Names of plans."""
    backend: str = "full-ekf"
    """The estimator."""
    seeds: int = 5
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    max_steps: int = 2500
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/bodies.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        files = [] if self.plans is None else [str(self.plans / f"{name}.json") for name in self.apartments]
        keys = []
        for world in [*self.worlds, *files]:
            check(self.trial(PAPER, world, 1))
            loaded = load_world(world)
            fitting = [case for case, robot in CASES.items() if fits(loaded, robot.radius_m)]
            seeds = range(self.first_seed, self.first_seed + self.seeds)
            keys += [(case, world, self.backend, seed, self.max_steps) for seed in seeds for case in fitting]
        tasks = [(key[:2] + key[3:4], [(key[0], Path(key[1]).stem, *key[2:])]) for key in keys]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one_of, self), self.jobs))
        plain_console(width=170).print(table(rows))

    def trial(self, case: str, world: str, seed: int) -> TrialConfig:
        """Return the trial of one robot in one building."""
        return TrialConfig(world, self.backend, seed=seed, max_steps=self.max_steps, robot=CASES[case])


def fits(world: World, radius_m: float) -> bool:
    """Return whether a body gets through the doors of a building, with so much to spare on either side."""
    covered = [world.reachable(radius + SPARE_M).buffer(radius).area for radius in (radius_m, RobotConfig.radius_m)]
    return bool(covered[0] >= FITS_SHARE * covered[1])


def _one_of(study: BodiesStudy, task: tuple[str, str, int]) -> list[Row]:
    case, world, seed = task
    return [one(study.trial(case, world, seed)) | {"case": case, "world": Path(world).stem}]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each robot in each building: its runs, and its steps over those of the paper's robot."""
    shown = Table(title="Bodies, and scanners off the axle", title_justify="left")
    for column in HEAD:
        shown.add_column(column, justify="left" if column in HEAD[:2] else "right")
    steps = {(row["world"], row["case"], row["seed"]): row["steps"] for row in rows}
    for world in dict.fromkeys(row["world"] for row in rows):
        for case in (case for case in CASES if any((row["case"], row["world"]) == (case, world) for row in rows)):
            own = [row for row in rows if (row["case"], row["world"]) == (case, world)]
            paper = [steps.get((world, PAPER, row["seed"])) for row in own]
            ratios = [row["steps"] / base for row, base in zip(own, paper, strict=True) if base]
            closed = f"{sum(row['contours_closed'] for row in own)} of {sum(row['contours_reachable'] for row in own)}"
            shown.add_row(
                case, world, f"{sum(row['status'] == 'complete' for row in own)} of {len(own)}",
                f"{min(row['coverage'] for row in own):.3f}", closed, f"{np.median([row['steps'] for row in own]):.0f}",
                f"{np.exp(np.mean(np.log(ratios))):.2f}" if ratios and case != PAPER else "",
                *(_median(own, name) for name in ("pose_anees", "map_anees")),
                str(sum(row["collisions"] for row in own)),
            )  # fmt: skip
    return shown


def _median(rows: Sequence[Row], name: str) -> str:
    found = [row[name] for row in rows if row[name] is not None]
    return f"{np.median(found):.2f}" if found else ""


if __name__ == "__main__":
    run_study(BodiesStudy)
