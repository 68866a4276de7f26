"""Turns that the wheels do not report: how soon after each the robot knows its pose again.

.venv/bin/python -m studies.robots.bumps --seeds 5     # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.scoring.summary import pose_nees
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial
from chainslam.sim.faults import FaultsConfig, bump_rad
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig, chance_in
from chainslam.slam.estimation.gates import gate_level
from chainslam.slam.geometry.poses import wrap

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.tables import headed

NAMES = ("beams", "world", "backend", "seed", "max_steps", "share", "bump_deg")
HEAD = (
    "beams", "runs", "complete", "lost, and said so", "turns", "recovered within 20 steps", "steps to it: median, most",
    "never, unnoticed", "pose ANEES: all steps", "outside the recovery: mean, most", "collisions",
)  # fmt: skip
WITHIN = 20
"""Steps after which a robot should know its pose again."""
SHARE = 0.25
"""It knows its heading again once its error is below this share of the turn, ..."""
CHANCE = 0.999
"""... and its pose once the NEES is below this quantile of chi-square."""


@dataclass(frozen=True)
class BumpsStudy:
    """Explore a world with each scanner while bumps turn the robot, and print a row for each."""

    world: str = "rooms"
    """A bundled world or a file."""
    backend: str = "full-ekf"
    """The estimator."""
    beams: tuple[int, ...] = (180, 541)
    """Of the scanners."""
    share: float = 0.02
    """Of the drives that end with a turn that the wheels do not report."""
    bump_deg: float = 8.0
    """How far it turns the robot."""
    seeds: int = 5
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    max_steps: int = 1500
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    any_code: bool = False
    """Whether rows of other versions of the code count, too."""
    out: Path = Path("studies/results/rows/in_text/bumps.jsonl")
    """A line of JSON for each run, as it ends. What it holds is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        check(self.trial(self.beams[0], 1))
        tasks = [
            ((beams, seed), [(beams, self.world, self.backend, seed, self.max_steps, self.share, self.bump_deg)])
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for beams in self.beams
        ]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one_of, self), self.jobs, self.any_code))
        plain_console(width=200).print(table(rows))

    def trial(self, beams: int, seed: int) -> TrialConfig:
        """Return the trial of one scanner and seed."""
        faults = FaultsConfig(bump=self.share, bump_rad=float(np.deg2rad(self.bump_deg)))
        robot = RobotConfig(lidar=LidarConfig(beams=beams), faults=faults)
        return TrialConfig(self.world, self.backend, seed=seed, max_steps=self.max_steps, robot=robot)


def _one_of(study: BumpsStudy, task: tuple[int, int]) -> list[Row]:
    beams, seed = task
    config = study.trial(beams, seed)
    result = run_trial(config)
    assert result.log is not None
    log, summary = result.log, result.summary
    chance = chance_in(result.scenario.world, seed)
    at = np.array([k + 1 for k in range(len(log) - 1) if bump_rad(config.robot.faults, chance, k)], dtype=int)
    nees = pose_nees(log)
    off_rad = np.abs(wrap(log.estimated_world[:, 2] - log.true_world[:, 2]))
    knows = (nees < gate_level(CHANCE, 3)) & (off_rad < SHARE * config.robot.faults.bump_rad)
    steps, outside = recoveries(at, knows & ~log.is_lost)
    return [
        {
            "beams": beams, "world": study.world, "backend": study.backend, "seed": seed, "max_steps": study.max_steps,
            "share": study.share, "bump_deg": study.bump_deg, "bumps": at.tolist(), "recovered_after": steps,
            "lost_steps": int(log.is_lost.sum()),
            "anees_outside": float(np.mean(nees[outside])) / 3.0 if outside.any() else None,
            **{key: summary[key] for key in ("status", "reason", "steps", "coverage", "pose_anees", "map_anees",
                                             "unstated_motions", "collisions")},
        }
    ]  # fmt: skip


def recoveries(
    bumps: Int[np.ndarray, " b"], knows: Bool[np.ndarray, " s"]
) -> tuple[list[int | None], Bool[np.ndarray, " s"]]:
    """Return after how many steps each bump was recovered from, None for never, and which steps lie outside.

    `bumps` are the first steps after each. A bump that follows before the one before was recovered from counts anew.
    """
    steps: list[int | None] = []
    outside = np.ones(len(knows), dtype=bool)
    for bump in bumps:
        again = np.flatnonzero(knows[bump:])
        steps.append(int(again[0]) if len(again) else None)
        outside[bump : bump + again[0] if len(again) else None] = False
    return steps, outside


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each scanner."""
    shown = headed("Turns that the wheels do not report", HEAD, 0)
    for beams in dict.fromkeys(row["beams"] for row in rows):
        own = [row for row in rows if row["beams"] == beams]
        found = [(steps, row) for row in own for steps in row["recovered_after"]]
        soon = sum(steps is not None and steps <= WITHIN for steps, _ in found)
        known = [steps for steps, _ in found if steps is not None]
        unnoticed = sum(steps is None and not row["reason"].startswith("lost") for steps, row in found)
        outside: Float[np.ndarray, " n"] = np.array([row["anees_outside"] for row in own])
        shown.add_row(
            str(beams), str(len(own)), str(sum(row["status"] == "complete" for row in own)),
            str(sum(row["reason"].startswith("lost") for row in own)), str(len(found)),
            f"{soon} ({100 * soon / max(len(found), 1):.0f} %)", f"{np.median(known):.0f}, {max(known)}",
            str(unnoticed), f"{np.mean([row['pose_anees'] for row in own]):.2f}",
            f"{outside.mean():.2f}, {outside.max():.2f}", str(sum(row["collisions"] for row in own)),
        )  # fmt: skip
    return shown


if __name__ == "__main__":
    run_study(BumpsStudy)
