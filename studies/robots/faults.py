"""What goes wrong with a robot without its saying so: how each fault ends, by a table in docs/robots.md.

.venv/bin/python -m studies.robots.faults              # goes on where it was interrupted, and writes the table anew
.venv/bin/python -m studies.robots.faults --any-code   # the table of all stored rows, whatever code made them
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.terminal.console import plain_console
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.people import PeopleConfig
from chainslam.sim.robot import RobotConfig

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.trials import one

HEAD = (
    "fault", "status", "steps", "over those without", "coverage, least", "pose ANEES", "map ANEES",
    "walls", "contacts", "reason",
)  # fmt: skip
NAMES = ("case", "world", "backend", "seed", "max_steps")
KEPT = (
    "status", "reason", "steps", "coverage", "pose_anees", "map_anees", "collisions", "unstated_motions",
    "lost_steps", "wheel_noise_factor", "lines", "processor_s",
)  # fmt: skip
BEGINS, ENDS = "<!-- made by `make robots`: begins -->", "<!-- made by `make robots`: ends -->"
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
    """Explore a world with each fault, and write a row for each into the page."""

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
    """Faults whose names hold one of these words; all without. The page stays as it is then."""
    jobs: int = 1
    """Number of processes."""
    any_code: bool = False
    """Whether rows of other versions of the code count, too."""
    out: Path = Path("studies/robots/rows.jsonl")
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""
    page: Path = Path("docs/robots.md")
    """Where the table goes."""

    def run(self) -> None:
        """Run what is to be run, print the table, and write it into the page; raises UsageError."""
        check(self.trial(SOUND, 1))
        cases = [case for case in CASES if not self.only or any(word in case for word in (SOUND, *self.only))]
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        keys = [(case, self.world, self.backend, seed, self.max_steps) for seed in seeds for case in cases]
        tasks = [((key[0], key[3]), [key]) for key in keys]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one_of, self), self.jobs, self.any_code))
        lines = lines_of(rows)
        plain_console(width=250).print("\n".join(lines))
        if not self.only:
            self.page.write_text(with_table(self.page.read_text(), lines))

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


def lines_of(rows: Sequence[Row]) -> list[str]:
    """Return the table's lines: for each fault what its runs have, one after another, by seed."""
    without = {row["seed"]: row["steps"] for row in rows if row["case"] == SOUND}
    lines = [_line(HEAD), _line(["---"] * len(HEAD))]
    for case in (case for case in CASES if any(row["case"] == case for row in rows)):
        own = sorted((row for row in rows if row["case"] == case), key=lambda row: row["seed"])
        ratios = [f"{row['steps'] / without[row['seed']]:.2f}" for row in own if row["seed"] in without]
        reasons = dict.fromkeys(row["reason"] for row in own)
        cells = (
            case, _each(dict.fromkeys(row["status"] for row in own)), _each(row["steps"] for row in own),
            "" if case == SOUND else _each(ratios), f"{min(row['coverage'] for row in own):.3f}",
            *(_each(_short(row[name]) for row in own) for name in ("pose_anees", "map_anees")),
            _each(row["lines"] for row in own), _each(row["collisions"] for row in own), "; ".join(reasons),
        )  # fmt: skip
        lines.append(_line(cells))
    return lines


def with_table(page: str, lines: Sequence[str]) -> str:
    """Return the page with these lines between its two marks; raises ValueError where it has none."""
    before, rest = page.split(BEGINS)
    _, after = rest.split(ENDS)
    return "\n".join([before + BEGINS, *lines, ENDS + after])


def _each(values: Iterable[object]) -> str:
    return ", ".join(map(str, values))


def _short(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}" if value < 1000.0 else f"{value:,.0f}"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    run_study(FaultsStudy)
