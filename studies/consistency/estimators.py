"""How honest each back end is on the same recordings: ANEES of pose and map over many seeds, with intervals.

Each seed is explored once with `--driver`; the recording then goes through every back end from every start covariance,
with the truth in place of extraction and association or not. Seeds are the samples (steps of one run are nearly one
draw): intervals are over runs.
"""

import functools
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from chainslam.experiments.replays.observations import DriveObservations, observations_of, ride
from chainslam.experiments.replays.recordings import record
from chainslam.experiments.replays.replay import Association, RecordedRun, ReplayOptions, replay
from chainslam.experiments.scenario import P0, P0_SIGMAS, TrialConfig, drawn_start, load_world
from chainslam.experiments.usage import UsageError, choose
from chainslam.sim.robot import chance_in
from chainslam.slam.backends import BACKENDS
from chainslam.slam.evaluation.consistency import anees, share_in_band

from ..runner.command import run_study
from ..runner.scores import Key, Scores, fill, show

KEY = ("world", "p0", "association", "perfect_extraction", "told_noise", "backend", "seed")
SCORES = ("pose_anees", "pose_nees_in_band", "map_anees", "pose_rmse_m", "lines", "duplicate_lines")


@dataclass(frozen=True)
class EstimatorStudy:
    """Send recordings of many seeds through several back ends, and print how honest each is."""

    world: str = "paper-fig8"
    """A bundled world or a file."""
    seeds: int = 100
    """Recordings."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    backends: tuple[str, ...] = tuple(BACKENDS)
    """The estimators."""
    p0: tuple[P0, ...] = ("small",)
    """Covariances of the start."""
    association: Association = "true"
    """Whose matches: the back end's own gate, or the truth."""
    perfect_extraction: bool = True
    """True lines with an error drawn as the measurement model states it."""
    told_noise: float = 1.0
    """The back ends are told this share of the observations' covariance: below 1 they must be found out."""
    driver: str = "full-ekf"
    """The estimator that explored, from a small start covariance, when the recordings were made."""
    recordings: Path | None = None
    """Folder in which recordings are kept and looked for; without it they are made anew."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/consistency.jsonl")
    """Where each replay gets a row as soon as it is done; a seed whose rows are there already is not run again."""

    def run(self) -> None:
        """Run the study, write a row for each replay and print one for each back end; raises UsageError."""
        for name in (*self.backends, self.driver):
            choose("back end", name, BACKENDS)
        for name in self.p0:
            choose("start covariance (--p0)", name, P0_SIGMAS)
        if not self.told_noise > 0 or (self.told_noise != 1.0 and self.association != "true"):
            raise UsageError(
                f"expected --told-noise above 0, and 1 without --association true, found {self.told_noise}: change it"
            )
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        tasks = {seed: [self.key(p0, name, seed) for p0 in self.p0 for name in self.backends] for seed in seeds}
        found = fill(self.out, (KEY, SCORES), tasks, functools.partial(rows_of, self), self.jobs)
        extraction = "stated noise" if self.perfect_extraction else "real extraction"
        told = "" if self.told_noise == 1.0 else f", told {self.told_noise} of it"
        for p0 in self.p0:
            runs = {name: np.array([found[self.key(p0, name, seed)][:3] for seed in seeds]) for name in self.backends}
            title = f"{self.world}, P0 {p0}, {self.seeds} seeds, {self.association} association, {extraction}{told}"
            show(title, runs, ("pose ANEES", "in band", "map ANEES"))

    def key(self, p0: str, name: str, seed: int) -> Key:
        """Return the key of one replay's row."""
        settings = self.association, str(self.perfect_extraction), str(float(self.told_noise))
        return self.world, p0, *settings, name, str(seed)


def rows_of(study: EstimatorStudy, seed: int) -> dict[Key, Scores]:
    """Record one seed, or find its recording, and send it through every back end; raises UsageError for a bad one."""
    made = record(TrialConfig(study.world, study.driver, seed=seed), study.recordings)
    drive = (
        observations_of(made, study.perfect_extraction).told(study.told_noise) if study.association == "true" else None
    )
    chance = chance_in(load_world(study.world), seed)
    rows: dict[Key, Scores] = {}
    for p0 in study.p0:
        pose, cov = drawn_start(chance, made.true_poses_world[0], p0)
        run = replace(made, trial=replace(made.trial, p0=p0), start_pose=pose, start_cov=cov)
        for name in study.backends:
            rows[study.key(p0, name, seed)] = (
                _replayed(run, name, study) if drive is None else _ridden(run, name, drive)
            )
    return rows


def _replayed(run: RecordedRun, name: str, study: EstimatorStudy) -> Scores:
    summary = replay(run, name, ReplayOptions(study.association, study.perfect_extraction)).summary
    return [summary[key] for key in SCORES]


def _ridden(run: RecordedRun, name: str, drive: DriveObservations) -> Scores:
    ridden = ride(BACKENDS[name].make(run.start_pose.copy(), run.start_cov.copy(), run.trial.backend_options), drive)
    off = ridden.estimated_world[:, :2] - ridden.true_poses_world[:, :2]
    rmse, lines = float(np.sqrt(np.mean(np.sum(off**2, axis=1)))), len(ridden.true_lines_world)
    try:
        values = ridden.pose_nees
        return anees(values, 3), share_in_band(values, 3), ridden.map_anees, rmse, lines, 0
    except np.linalg.LinAlgError:
        return None, None, None, rmse, lines, 0


if __name__ == "__main__":
    run_study(EstimatorStudy)
