"""Do the scores bite? Filters that are told half of a noise, and one that is told all of it, in many campaigns.

A robot stands still for a while in a room and then drives round. The back ends run alone, with the true association and
the stated noise. A campaign rejects where the 95 % interval of its mean ANEES leaves out 1.

.venv/bin/python -m studies.results.teeth
"""

import itertools
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from rich.table import Table

from experiments.campaign.workers import on_workers
from experiments.replays.corridor import look
from experiments.replays.observations import DriveObservations, ride
from experiments.scenario import KNOWN, P0, P0_SIGMAS, drawn_start, sigmas_of
from experiments.scoring.statistics import mean_interval
from experiments.terminal.console import plain_console
from experiments.usage import choose
from sim.chance import Chance, Channel, world_key
from slam.backends import BACKENDS
from slam.evaluation.from_start import Start, from_start
from slam.geometry.lines import through
from slam.geometry.poses import compose, inverse
from slam.robot import ScannerSpec

from ..runner.command import run_study

SIDE_M, RADIUS_M, STEP_M = 5.0, 1.0, 0.1
AT_REST = 20
"""Scans before the robot drives: the first walls are then known well, and errors of the drive do not last."""
STILL_SIGMAS = 1e-6, 1e-6, 1e-7
WHEELS = 0.0044, 0.0019, float(np.deg2rad(0.19))
"""Standard deviations along m, across m, of the heading rad in one metre; they grow with the square root of the way."""
TOLD = ("all", "R/2", "Q/2")


@dataclass(frozen=True)
class TeethStudy:
    """Print how many campaigns reject each back end, told all noise or half of one, by each score of the pose."""

    backends: tuple[str, ...] = ("full-ekf", "fej-ekf", "invariant-ekf", "graph")
    """The estimators."""
    p0: P0 = "small"
    """Covariance of the start."""
    campaigns: int = 100
    """How many."""
    runs: int = 20
    """Runs of each campaign."""
    first_seed: int = 1
    """The seed of the first run; the others follow it."""
    jobs: int = 2
    """Number of processes."""

    def run(self) -> None:
        """Run the study and print a row for each back end; raises UsageError."""
        for name in self.backends:
            choose("back end", name, BACKENDS)
        choose("start covariance (--p0)", self.p0, P0_SIGMAS)
        seeds = list(range(self.first_seed, self.first_seed + self.campaigns * self.runs))
        tasks = [(name, told, seed) for name in self.backends for told in TOLD for seed in seeds]
        perform = partial(scores, self.p0)
        found = map(perform, tasks) if self.jobs <= 1 else on_workers(perform, _lost, self.jobs)(tasks)
        by_kind: dict[tuple[str, str], list[tuple[float, float]]] = {}
        for (name, told, _), both in found:
            by_kind.setdefault((name, told), []).append(both)
        title = f"{self.campaigns} campaigns of {self.runs} runs, P0 {self.p0}"
        table = Table("back end", "told", "ANEES from the start", "rejected", "pose ANEES", "rejected ", title=title)
        for name, told in itertools.product(self.backends, TOLD):
            values = np.array(by_kind[name, told]).T
            cells = [(f"{each.mean():.3f}", f"{rejected(each, self.runs)} of {self.campaigns}") for each in values]
            table.add_row(name, told, *cells[0], *cells[1])
        plain_console(width=110).print(table)


def scores(p0: str, task: tuple[str, str, int]) -> tuple[tuple[str, str, int], tuple[float, float]]:
    """Return a task (back end, told, seed) with the ANEES of its poses relative to the start, and of its poses."""
    name, told, seed = task
    drive = round_a_room(seed)
    if told == "R/2":
        drive = drive.told(0.5)
    elif told == "Q/2":
        drive = replace(drive, odometry_cov=0.5 * drive.odometry_cov)
    true = drive.true_poses_world[0]
    pose, cov = drawn_start(drive.chance, true, p0)
    entry, start = BACKENDS[name], Start(pose, cov, true)
    backend = entry.make(pose.copy(), cov.copy())
    known = start.known(sigmas_of(KNOWN))
    ridden = ride(backend, drive, from_start(backend, entry.carries_start, start, known, entry.make, ScannerSpec()))
    driven = slice(AT_REST, None)
    both = ridden.pose_nees_from_start[driven].mean() / 3.0, ridden.pose_nees[driven].mean() / 3.0
    return task, (float(both[0]), float(both[1]))


def rejected(values: Float[np.ndarray, " n"], runs: int) -> int:
    """Return how many campaigns of so many runs each have an interval of their mean without 1."""
    ends = [mean_interval(campaign) for campaign in values.reshape(-1, runs)]
    return sum(not each[0] <= 1.0 <= each[1] for each in ends if each is not None)


def round_a_room(seed: int) -> DriveObservations:
    """Return what a robot with stated noise sees of four walls, at rest and then once round."""
    corners = SIDE_M * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    walls = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    turn = STEP_M / RADIUS_M
    angle = np.concatenate([np.zeros(AT_REST), turn * np.arange(int(2.0 * np.pi / turn) + 1)])
    poses = np.stack([np.sin(angle), -np.cos(angle), angle], axis=-1)
    poses[:, :2] = 0.5 * SIDE_M + RADIUS_M * poses[:, :2]
    poses[:, 2] = (poses[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    chance = Chance(seed, world_key(walls, poses[0]))
    motions = np.array([compose(inverse(a), b) for a, b in pairwise(poses)])
    drives = np.hypot(motions[:, 0], motions[:, 1]) > 0.0
    sigmas = np.where(drives[:, None], np.sqrt(STEP_M) * np.array(WHEELS), STILL_SIGMAS)
    draws = np.array([chance.standard_normals(Channel.WHEELS, k, 3) for k in range(len(motions))])
    covs = sigmas[:, :, None] ** 2 * np.eye(3)
    again, first, lines, known = [], [], through(walls), np.zeros(len(walls), dtype=bool)
    for k, pose in enumerate(poses):
        looks = look(walls, lines, pose, chance.standard_normals(Channel.LASER, k, 2 * len(walls)).reshape(-1, 2))
        old = known[looks.walls]
        again.append(looks.take(old))
        first.append(looks.take(~old))
        known[looks.walls] = True
    reported = np.concatenate([np.zeros((1, 3)), motions + sigmas * draws])
    stated = np.concatenate([covs[:1], covs])
    return DriveObservations(reported, stated, tuple(again), tuple(first), poses, dict(enumerate(lines)), chance)


def _lost(task: tuple[str, str, int], reason: str) -> tuple[tuple[str, str, int], tuple[float, float]]:
    raise RuntimeError(f"expected the scores of {task}, found none: {reason}")


if __name__ == "__main__":
    run_study(TeethStudy)
