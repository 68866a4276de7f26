"""Closing a long loop: how honest each back end is, by the loop's length and the heading that its wheels lose.

The back ends run alone, with the true association and the stated noise, on rings of corridors made here. Each seed is
another ring; every back end meets the same ones.
"""

import functools
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from chainslam.experiments.replays.corridor import Loop, drive
from chainslam.experiments.replays.observations import DriveObservations, ride
from chainslam.experiments.scenario import P0, P0_SIGMAS, drawn_start
from chainslam.experiments.usage import UsageError, choose
from chainslam.slam.backends import BACKENDS
from chainslam.slam.geometry.poses import wrap

from ..runner.command import run_study
from ..runner.scores import Key, Scores, fill, show

KEY = ("length_m", "heading_deg", "gap_m", "p0", "backend", "seed")
SCORES = ("pose_anees", "closed_pose_anees", "map_anees", "heading_error_deg", "lines")


@dataclass(frozen=True)
class LoopStudy:
    """Drive rings of corridors with several back ends, and print how honest each is."""

    backends: tuple[str, ...] = ("full-ekf", "fej-ekf", "invariant-ekf", "graph")
    """The estimators."""
    length_m: tuple[float, ...] = (200.0,)
    """Lengths of the ring."""
    heading_deg: tuple[float, ...] = (0.6,)
    """Standard deviations of the heading that the wheels lose in a metre; it grows with the square root."""
    gap_m: tuple[float, ...] = (0.0, 15.0)
    """Lengths of the last stretch before the ring closes in which nothing is seen."""
    p0: P0 = "small"
    """Covariance of the start."""
    seeds: int = 100
    """Rings of each kind."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/loops.jsonl")
    """Where each drive gets a row as soon as it is done; rows that are there already are not run again."""

    def run(self) -> None:
        """Run the study, write a row for each drive and print one for each back end; raises UsageError."""
        for name in self.backends:
            choose("back end", name, BACKENDS)
        choose("start covariance (--p0)", self.p0, P0_SIGMAS)
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        kinds = [Loop(*numbers) for numbers in itertools.product(self.length_m, self.heading_deg, self.gap_m)]
        for loop in kinds:
            if loop.length_m < 20.0 or loop.heading_deg <= 0.0 or not 0.0 <= loop.gap_m < loop.length_m:
                raise UsageError(f"expected 20 m or more, a heading above 0 and a gap below the length, found {loop}")
        tasks = {(loop, seed): [self.key(loop, n, seed) for n in self.backends] for loop in kinds for seed in seeds}
        found = fill(self.out, (KEY, SCORES), tasks, functools.partial(rows_of, self), self.jobs)
        for loop in kinds:
            runs = {n: np.array([found[self.key(loop, n, seed)][:4] for seed in seeds]) for n in self.backends}
            title = f"{loop.length_m:g} m, {loop.heading_deg:g} degrees a root metre, nothing seen for {loop.gap_m:g} m"
            show(title, runs, ("pose ANEES", "once closed", "map ANEES", "worst heading error, degrees"))

    def key(self, loop: Loop, name: str, seed: int) -> Key:
        """Return the key of one drive's row."""
        return str(loop.length_m), str(loop.heading_deg), str(loop.gap_m), self.p0, name, str(seed)


def rows_of(study: LoopStudy, task: tuple[Loop, int]) -> dict[Key, Scores]:
    """Make one ring and send its drive through every back end."""
    loop, seed = task
    seen = drive(loop, seed)
    return {study.key(loop, name, seed): ridden_scores(study.p0, name, loop, seen) for name in study.backends}


def ridden_scores(p0: str, name: str, loop: Loop, seen: DriveObservations) -> Scores:
    """Return the scores of one back end on one ring's drive: None where its covariance is none."""
    ridden = ride(BACKENDS[name].make(*drawn_start(seen.chance, seen.true_poses_world[0], p0)), seen)
    heading = np.abs(wrap(ridden.estimated_world[:, 2] - ridden.true_poses_world[:, 2])).max()
    rest = float(np.rad2deg(heading)), len(ridden.true_lines_world)
    try:
        each = ridden.pose_nees / 3.0
        return float(each.mean()), float(each[loop.closing_step :].mean()), ridden.map_anees, *rest
    except np.linalg.LinAlgError:
        return None, None, None, *rest


if __name__ == "__main__":
    run_study(LoopStudy)
