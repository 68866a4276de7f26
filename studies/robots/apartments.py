"""Real plans with the scanner of many service robots: 541 beams over 270 degrees, 10 m, sigma 15 mm, 1 % dropouts.

.venv/bin/python -m studies.robots.apartments --plans ../shared/data/plans   # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig

from ..runner.command import run_study
from ..runner.rows import Row
from ..runner.tables import headed
from ..runner.trials import rows_of

ROBOT = RobotConfig(
    lidar=LidarConfig(beams=541, fov_rad=1.5 * np.pi, range_max_m=10.0, sigma_m=0.015),
    faults=FaultsConfig(dropout=0.01),
)
HEAD = ("plan", "status", "coverage", "contours", "steps", "pose ANEES", "map ANEES", "collisions", "processor, s")


@dataclass(frozen=True)
class ApartmentsStudy:
    """Explore every so many apartments with this scanner, and print a row for each."""

    plans: Path
    """Folder of plan files."""
    every: int = 4
    """Every so many plans by name."""
    pattern: str = "lifull_*.json"
    """Which files of the folder."""
    backend: str = "invariant-ekf"
    """The estimator."""
    seed: int = 1
    """Of the noise."""
    max_steps: int = 4000
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    any_code: bool = False
    """Whether rows of other versions of the code count, too."""
    out: Path = Path("studies/results/rows/in_text/scanner-apartments.jsonl")
    """A line of JSON for each run, as it ends. What it holds is not run again."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials, a plan after the other; raises UsageError for a folder without plans."""
        plans = sorted(self.plans.glob(self.pattern))[:: self.every]
        if not plans:
            raise UsageError(f"expected plan files in {self.plans}, found no {self.pattern}")
        return [
            TrialConfig(str(plan), self.backend, seed=self.seed, max_steps=self.max_steps, robot=ROBOT)
            for plan in plans
        ]

    def run(self) -> None:
        """Run the study and print its table, with what did not end as complete."""
        rows = list(rows_of(self.trials(), self.out, self.jobs, any_code=self.any_code))
        console = plain_console(width=150)
        console.print(table(rows))
        found = [row["coverage"] for row in rows if row.get("coverage") is not None]
        console.print(
            f"mean coverage {np.mean(found):.4f}, {sum(row['status'] == 'complete' for row in rows)} complete"
        )
        for row in rows:
            if row["status"] != "complete":
                console.print(f"{row['world']}: {row['status']}, {row['reason']}")


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each plan."""
    shown = headed(f"{len(rows)} apartments, 541 beams over 270 degrees", HEAD, 2)
    for row in rows:
        numbers = (f"{row[name]:.2f}" if row.get(name) is not None else "-" for name in ("pose_anees", "map_anees"))
        shown.add_row(
            row["world"], row["status"], f"{row.get('coverage') or 0.0:.3f}",
            f"{row.get('contours_closed')} of {row.get('contours_reachable')}", str(row.get("steps")), *numbers,
            str(row.get("collisions")), f"{row.get('processor_s', 0.0):.0f}",
        )  # fmt: skip
    return shown


if __name__ == "__main__":
    run_study(ApartmentsStudy)
