"""Do the scores bite? Filters that are told half of a noise, and one that is told all of it, in many campaigns.

A robot stands still for a while in a room and then drives round. The back ends run alone, with the true association and
the stated noise. A campaign rejects where the 95 % interval of its mean ANEES leaves out 1.

A hundred campaigns know a share of 5 % to 4 % only, so two more shares stand beside theirs: of many campaigns drawn
from all the runs together, and of those with the runs' mean brought to 1. The last is the ruler's own level, whatever
the filter does. With `--noise-share 0.01` all noise is so small that the filter is exactly linear.

.venv/bin/python -m studies.results.teeth
"""

import itertools
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.campaign.workers import on_workers
from chainslam.experiments.replays.corridor import look
from chainslam.experiments.replays.observations import DriveObservations, ride
from chainslam.experiments.scenario import KNOWN, P0, P0_SIGMAS, drawn_start, sigmas_of
from chainslam.experiments.scoring.statistics import mean_interval
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError, choose
from chainslam.sim.chance import Chance, Channel, world_key
from chainslam.slam.backends import BACKENDS
from chainslam.slam.evaluation.from_start import Start, from_start
from chainslam.slam.geometry.lines import through
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.robot import ScannerSpec

from ..runner.command import run_study

SIDE_M, RADIUS_M, STEP_M = 5.0, 1.0, 0.1
AT_REST = 20
"""Scans before the robot drives: the first walls are then known well, and errors of the drive do not last."""
STILL_SIGMAS = 1e-6, 1e-6, 1e-7
WHEELS = 0.0044, 0.0019, float(np.deg2rad(0.19))
"""Standard deviations along m, across m, of the heading rad in one metre; they grow with the square root of the way."""
TOLD: tuple[Literal["all", "R/2", "Q/2"], ...] = ("all", "R/2", "Q/2")
DRAWN = 1000
"""Campaigns drawn from all runs together."""


@dataclass(frozen=True)
class TeethStudy:
    """Print how many campaigns reject each back end, told all noise or half of one, by each score of the pose."""

    backends: tuple[str, ...] = ("full-ekf", "fej-ekf", "invariant-ekf", "graph")
    """The estimators."""
    told: tuple[Literal["all", "R/2", "Q/2"], ...] = TOLD
    """What they are told of the noise."""
    p0: P0 = "small"
    """Covariance of the start."""
    campaigns: int = 100
    """How many."""
    runs: int = 20
    """Runs of each campaign."""
    first_seed: int = 1
    """The seed of the first run; the others follow it."""
    noise_share: float = 1.0
    """All standard deviations, those of the start too, are this share of what they are."""
    jobs: int = 2
    """Number of processes."""

    def run(self) -> None:
        """Run the study and print a row for each back end; raises UsageError."""
        for name in self.backends:
            choose("back end", name, BACKENDS)
        choose("start covariance (--p0)", self.p0, P0_SIGMAS)
        if not 0.0 < self.noise_share <= 1.0:
            raise UsageError(f"expected --noise-share above 0 and up to 1, found {self.noise_share}: change it")
        seeds = list(range(self.first_seed, self.first_seed + self.campaigns * self.runs))
        tasks = [(name, told, seed) for name in self.backends for told in self.told for seed in seeds]
        perform = partial(scores, self.p0, share=self.noise_share)
        found = map(perform, tasks) if self.jobs <= 1 else on_workers(perform, _lost, self.jobs)(tasks)
        by_kind: dict[tuple[str, str], list[tuple[float, float]]] = {}
        for (name, told, _), both in found:
            by_kind.setdefault((name, told), []).append(both)
        title = f"{self.campaigns} campaigns of {self.runs} runs, P0 {self.p0}, {self.noise_share:g} of all noise"
        head = "rejected, % of drawn, % at mean 1"
        table = Table("back end", "told", "ANEES from the start", head, "pose ANEES", f"{head} ", title=title)
        for name, told in itertools.product(self.backends, self.told):
            values = np.array(by_kind[name, told]).T
            cells = [cell for each in values for cell in (mean_in_words(each), rejected_in_words(each, self.runs))]
            table.add_row(name, told, *cells)
        plain_console(width=140).print(table)


def scores(p0: str, task: tuple[str, str, int], share: float = 1.0) -> tuple[tuple[str, str, int], tuple[float, float]]:
    """Return a task (back end, told, seed) with the ANEES of its poses relative to the start, and of its poses."""
    name, told, seed = task
    drive = round_a_room(seed, share)
    if told == "R/2":
        drive = drive.told(0.5)
    elif told == "Q/2":
        drive = replace(drive, odometry_cov=0.5 * drive.odometry_cov)
    true = drive.true_poses_world[0]
    drawn = Start(*drawn_start(drive.chance, true, p0), true)
    entry, start, known = BACKENDS[name], *(drawn.known(share * sigmas_of(each)) for each in (p0, KNOWN))
    backend = entry.make(start.estimate_world.copy(), start.cov.copy())
    ridden = ride(backend, drive, from_start(backend, entry.carries_start, start, known, entry.make, ScannerSpec()))
    driven = slice(AT_REST, None)
    both = ridden.pose_nees_from_start[driven].mean() / 3.0, ridden.pose_nees[driven].mean() / 3.0
    return task, (float(both[0]), float(both[1]))


def rejected(values: Float[np.ndarray, " n"], runs: int) -> int:
    """Return how many campaigns of so many runs each have an interval of their mean without 1."""
    ends = [mean_interval(campaign) for campaign in values.reshape(-1, runs)]
    return sum(not each[0] <= 1.0 <= each[1] for each in ends if each is not None)


def mean_in_words(values: Float[np.ndarray, " n"]) -> str:
    """Return a mean and its standard error."""
    return f"{values.mean():.3f} +- {values.std(ddof=1) / np.sqrt(len(values)):.3f}"


def rejected_in_words(values: Float[np.ndarray, " n"], runs: int) -> str:
    """Return how many campaigns reject, which share of those drawn from all runs does, and which with their mean 1."""
    drawn = np.random.default_rng(0).choice(values, (DRAWN, runs))
    shares = (100.0 * rejected(each.ravel(), runs) / DRAWN for each in (drawn, drawn / values.mean()))
    return ", ".join([f"{rejected(values, runs)} of {len(values) // runs}", *(f"{share:.1f}" for share in shares)])


def round_a_room(seed: int, share: float = 1.0) -> DriveObservations:
    """Return what a robot with stated noise, or a share of it, sees of four walls, at rest and then once round."""
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
    sigmas = share * np.where(drives[:, None], np.sqrt(STEP_M) * np.array(WHEELS), STILL_SIGMAS)
    draws = np.array([chance.standard_normals(Channel.WHEELS, k, 3) for k in range(len(motions))])
    covs = sigmas[:, :, None] ** 2 * np.eye(3)
    again, first, lines, known = [], [], through(walls), np.zeros(len(walls), dtype=bool)
    for k, pose in enumerate(poses):
        looks = look(
            walls, lines, pose, chance.standard_normals(Channel.LASER, k, 2 * len(walls)).reshape(-1, 2), share
        )
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
