"""What goes wrong with a robot without its saying so: how each fault ends.

.venv/bin/python -m studies.robots.faults     # goes on where it was interrupted; `make results` makes its page
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.views.numbers import markdown
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.people import PeopleConfig
from chainslam.sim.robot import RobotConfig

from ..runner.command import run_study
from ..runner.marks import short
from ..runner.rows import Row, rows_of
from ..runner.trials import one

HEAD = (
    "fault", "status", "steps", "over those without the fault", "coverage, least", "pose ANEES", "map ANEES",
    "walls", "collisions", "reason",
)  # fmt: skip
NAMES = ("case", "world", "backend", "seed", "max_steps")
KEPT = (
    "status", "reason", "steps", "coverage", "pose_anees", "map_anees", "collisions", "unstated_motions",
    "lost_steps", "wheel_noise_factor", "lines", "processor_s",
)  # fmt: skip
ROWS = Path("studies/robots/rows.jsonl")
SOUND = "none"
FROM = 100
"""From this scan or drive on, of the faults that begin on the way."""
DOOR = (3.95, 2.25)
"""In the first door that the robot comes to in `rooms`."""
CASES: Mapping[str, FaultsConfig] = {
    SOUND: FaultsConfig(),
    "one person walks": FaultsConfig(people=PeopleConfig(walking=1)),
    "three people walk": FaultsConfig(people=PeopleConfig(walking=3)),
    "one stands in a doorway for a minute": FaultsConfig(people=PeopleConfig(standing=DOOR, leave_s=60.0)),
    "three own posts at 0.15 m": FaultsConfig(posts=3),
    "5 % dropouts": FaultsConfig(dropout=0.05),
    "5 % dropouts in runs of 8": FaultsConfig(dropout=0.05, clump=8),
    "half of the edges mixed": FaultsConfig(mixed=0.5),
    "bumps of 8 degrees": FaultsConfig(bump=0.02),
    "slip of three times": FaultsConfig(slip=3.0),
    "all scans in motion": FaultsConfig(moving=1.0),
    "ranges 15 mm too long": FaultsConfig(range_bias_m=0.015),
    "ranges 30 mm too long": FaultsConfig(range_bias_m=0.03),
    "ranges 1 % too long": FaultsConfig(range_scale=1.01),
    "ranges in steps of 25 mm": FaultsConfig(resolution_m=0.025),
    "mirrored scans": FaultsConfig(mirrored=True),
    "scanner turned by 90 degrees": FaultsConfig(scanner_turned_rad=0.5 * np.pi),
    "scanner turned by 20 degrees": FaultsConfig(scanner_turned_rad=np.pi / 9.0),
    "scanner 0.12 m ahead": FaultsConfig(scanner_ahead_m=0.12),
    "scanner 0.2 m to the left": FaultsConfig(scanner_left_m=0.2),
    "scans one step late": FaultsConfig(late=1),
    "the scanner repeats one scan": FaultsConfig(frozen_from=FROM),
    "the wheels turn, the robot stands": FaultsConfig(stuck_from=FROM),
}
"""By the words of the table, in its order."""


@dataclass(frozen=True)
class FaultsStudy:
    """Explore a world with each fault, and print a row for each."""

    world: str = "rooms"
    """A bundled world or a file."""
    backend: str = "invariant-ekf"
    """The estimator."""
    beams: int = 360
    """Of the scanner."""
    seeds: int = 2
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    max_steps: int = 1500
    """A run is stopped after this many scans."""
    only: tuple[str, ...] = ()
    """Faults whose names hold one of these words; all without."""
    jobs: int = 1
    """Number of processes."""
    out: Path = ROWS
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        check(self.trial(SOUND, 1))
        cases = [case for case in CASES if not self.only or any(word in case for word in (SOUND, *self.only))]
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        keys = [(case, self.world, self.backend, seed, self.max_steps) for seed in seeds for case in cases]
        tasks = [((key[0], key[3]), [key]) for key in keys]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one_of, self), self.jobs))
        plain_console(width=250).print(markdown(table(rows)))

    def trial(self, case: str, seed: int) -> TrialConfig:
        """Return the trial of one fault."""
        robot = RobotConfig(lidar=LidarConfig(beams=self.beams), faults=CASES[case])
        return TrialConfig(self.world, self.backend, seed=seed, max_steps=self.max_steps, robot=robot)


def _one_of(study: FaultsStudy, task: tuple[str, int]) -> list[Row]:
    case, seed = task
    row = one(study.trial(case, seed))
    kept = {key: row.get(key) for key in KEPT}
    names = {"case": case, "world": study.world, "backend": study.backend, "seed": seed, "max_steps": study.max_steps}
    return [names | kept]


def table(rows: Sequence[Row]) -> list[list[str]]:
    """Return for each fault what its runs have, one after another, by seed."""
    without = {row["seed"]: row["steps"] for row in rows if row["case"] == SOUND}
    found = [list(HEAD)]
    for case, own in by_case(rows).items():
        ratios = [f"{row['steps'] / without[row['seed']]:.2f}" for row in own if row["seed"] in without]
        reasons = dict.fromkeys(row["reason"] for row in own)
        found.append([
            case, _each(dict.fromkeys(row["status"] for row in own)), _each(row["steps"] for row in own),
            "" if case == SOUND else _each(ratios), f"{min(row['coverage'] for row in own):.3f}",
            *(_each(_score(row[name]) for row in own) for name in ("pose_anees", "map_anees")),
            _each(row["lines"] for row in own), _each(row["collisions"] for row in own), "; ".join(reasons),
        ])  # fmt: skip
    return found


def by_case(rows: Sequence[Row]) -> Mapping[str, list[Row]]:
    """Return the rows of each fault by seed, in the order of the faults."""
    ordered = sorted(rows, key=lambda row: row["seed"])
    found = {case: [row for row in ordered if row["case"] == case] for case in CASES}
    return {case: own for case, own in found.items() if own}


def _each(values: Iterable[object]) -> str:
    return ", ".join(map(str, values))


def _score(value: float | None) -> str:
    return "-" if value is None else short(value)


if __name__ == "__main__":
    run_study(FaultsStudy)
