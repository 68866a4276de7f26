"""Other scanners, and their faults: whether exploration still ends, and how much longer it takes.

.venv/bin/python -m studies.robots.scanners --seeds 5     # goes on where it was interrupted
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.terminal.console import plain_console
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.tables import headed
from ..runner.trials import one

HEAD = (
    "scanner; fault", "complete", "coverage, least", "contours", "steps, median", "steps over those without",
    "pose ANEES, median", "map ANEES, median", "collisions", "motions found", "lost", "wheel noise",
    "noticed, most steps",
)  # fmt: skip
NAMES = ("case", "world", "backend", "seed", "max_steps")
SCANNERS = {
    "180 beams": LidarConfig(),
    "360 beams": LidarConfig(beams=360),
    "541 beams": LidarConfig(beams=541),
    "1,081 beams, 270 degrees": LidarConfig(beams=1081, fov_rad=1.5 * np.pi),
}
FAULTS = {
    "": FaultsConfig(),
    "5 % dropouts": FaultsConfig(dropout=0.05),
    "half of the edges mixed": FaultsConfig(mixed=0.5),
}
WHEELS = {
    "bumps of 8 degrees": FaultsConfig(bump=0.02),
    "bumps of 60 degrees": FaultsConfig(bump=0.01, bump_rad=float(np.deg2rad(60.0))),
    "slip of three times": FaultsConfig(slip=3.0),
    "all scans in motion": FaultsConfig(moving=1.0),
}
"""What the wheels do not report, and how the robot moves while it scans."""


def cases() -> Mapping[str, RobotConfig]:
    """Return the robots by name; those with a fault have the name of the one without before a semicolon."""
    robots = {
        f"{scanner}; {fault}".removesuffix("; "): RobotConfig(lidar=lidar, faults=wrong)
        for scanner, lidar in SCANNERS.items()
        for fault, wrong in FAULTS.items()
    }
    far = LidarConfig(beams=541, range_max_m=10.0)
    robots["541 beams, 10 m"] = RobotConfig(lidar=far)
    robots["541 beams, 10 m; noise of 1 % of the range, stated"] = RobotConfig(
        lidar=LidarConfig(beams=541, range_max_m=10.0, sigma_share=0.01)
    )
    robots |= {
        f"541 beams; {fault}": RobotConfig(lidar=SCANNERS["541 beams"], faults=wrong) for fault, wrong in WHEELS.items()
    }
    return robots


@dataclass(frozen=True)
class ScannersStudy:
    """Explore a world with each scanner and fault, and print a row for each."""

    world: str = "rooms"
    """A bundled world or a file."""
    backend: str = "full-ekf"
    """The estimator."""
    seeds: int = 5
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    max_steps: int = 1500
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/scanners.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        check(self.trial("180 beams", 1))
        keys = [
            (name, self.world, self.backend, seed, self.max_steps)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for name in cases()
        ]
        tasks = [((key[0], key[3]), [key]) for key in keys]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one_of, self), self.jobs))
        plain_console(width=170).print(table(rows))

    def trial(self, case: str, seed: int) -> TrialConfig:
        """Return the trial of one robot."""
        return TrialConfig(self.world, self.backend, seed=seed, max_steps=self.max_steps, robot=cases()[case])


def _one_of(study: ScannersStudy, task: tuple[str, int]) -> list[Row]:
    case, seed = task
    return [one(study.trial(case, seed)) | {"case": case, "world": study.world}]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each case: its runs, and its steps over those of the same scanner without the fault."""
    shown = headed("Scanners and their faults", HEAD)
    steps: dict[str, dict[int, int]] = {}
    for row in rows:
        steps.setdefault(row["case"], {})[row["seed"]] = row["steps"]
    for case in steps:
        own = [row for row in rows if row["case"] == case]
        without = steps.get(case.partition(";")[0], {})
        ratios = [row["steps"] / without[row["seed"]] for row in own if row["seed"] in without]
        closed = f"{sum(row['contours_closed'] for row in own)} of {sum(row['contours_reachable'] for row in own)}"
        anees = [_median(own, name) for name in ("pose_anees", "map_anees")]
        shown.add_row(
            case, f"{sum(row['status'] == 'complete' for row in own)} of {len(own)}",
            f"{min(row['coverage'] for row in own):.3f}", closed, f"{np.median([row['steps'] for row in own]):.0f}",
            f"{np.exp(np.mean(np.log(ratios))):.2f}" if ratios and ";" in case else "", *anees,
            str(sum(row["collisions"] for row in own)), str(sum(row["unstated_motions"] for row in own)),
            str(sum(row["lost_steps"] > 0 for row in own)), _median(own, "wheel_noise_factor"), _noticed(own),
        )  # fmt: skip
    return shown


def _noticed(rows: Sequence[Row]) -> str:
    """Return after how many steps at most the wheels' noise was taken to be larger, where it was in all runs."""
    found = [int(row["wheel_noise_step"]) for row in rows if row.get("wheel_noise_step") is not None]
    return str(max(found)) if found and len(found) == len(rows) else ""


def _median(rows: Sequence[Row], name: str) -> str:
    return f"{np.median([row[name] for row in rows if row[name] is not None]):.2f}"


if __name__ == "__main__":
    run_study(ScannersStudy)
