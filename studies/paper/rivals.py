"""What does the shortcut cost, and is there an honest one? Every back end on the same drives.

Matches are true and noise is as stated. Drives of figures 8 and 9 are explored once with `--driver`; a ring of
corridors is driven without a mapper. The ideal EKF, whose Jacobians are at the truth, rides along.
"""

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from rich.table import Table

from experiments.replays.corridor import Loop, drive
from experiments.replays.ideal import NAME as IDEAL
from experiments.replays.ideal import IdealEkf
from experiments.replays.observations import DriveObservations, Ridden, observations_of, ride
from experiments.replays.recordings import record
from experiments.scenario import P0, P0_SIGMAS, TrialConfig, drawn_start
from experiments.terminal.console import plain_console
from experiments.usage import UsageError, choose
from slam.backends import BACKENDS
from slam.estimation.backend import POSE, Backend, Observations
from slam.estimation.models import innovations, stack
from slam.evaluation.consistency import anees, nis

from ..runner.command import run_study
from ..runner.scores import Key, Scores, fill

KEY = ("place", "p0", "backend", "seed")
SCORES = ("pose_anees", "map_anees", "nis", "pose_rms_m", "pose_sigma_m", "line_sigma_m")
RING_M = 60.0
PLACES = ("paper-fig8", "paper-fig9", f"ring of {RING_M:g} m")
EVERY = (*(name for name in BACKENDS if name != "graph-batch"), IDEAL)
"""What rides along; until the end `graph-batch` is `graph`."""


@dataclass(frozen=True)
class RivalStudy:
    """Ride the same drives with every back end, and print how honest and how precise each is."""

    places: tuple[str, ...] = PLACES
    """Where."""
    backends: tuple[str, ...] = EVERY
    """The estimators."""
    seeds: int = 20
    """Drives in each place."""
    first_seed: int = 1
    """Of the drives."""
    p0: P0 = "small"
    """Covariance of the start."""
    driver: str = "full-ekf"
    """The estimator that explored figures 8 and 9."""
    recordings: Path | None = None
    """Folder in which recordings are kept and looked for; without it they are made anew."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/rivals.jsonl")
    """Where each ride gets a row; what has its row already is not ridden again."""

    def run(self) -> None:
        """Run the study, write a row for each ride and print one for each back end; raises UsageError."""
        for name in self.backends:
            choose("back end", name, EVERY)
        for place in self.places:
            choose("place", place, PLACES)
        choose("start covariance (--p0)", self.p0, P0_SIGMAS)
        if self.seeds < 1:
            raise UsageError(f"expected --seeds of 1 or more, found {self.seeds}: change it")
        seeds = range(self.first_seed, self.first_seed + self.seeds)
        tasks = {
            (place, seed): [self.key(place, n, seed) for n in self.backends] for place in self.places for seed in seeds
        }
        found = fill(self.out, (KEY, SCORES), tasks, functools.partial(rows_of, self), self.jobs)
        for place in self.places:
            runs = {n: np.array([found[self.key(place, n, seed)] for seed in seeds]) for n in self.backends}
            show(f"{place}, P0 {self.p0}, true matches, stated noise, seeds {seeds[0]} to {seeds[-1]}", runs)

    def key(self, place: str, name: str, seed: int) -> Key:
        """Return the key of one ride's row."""
        return place, self.p0, name, str(seed)


def show(title: str, runs: dict[str, Float[np.ndarray, "r c"]]) -> None:
    """Print the mean of each score over the drives and, in brackets, its median; sigmas and errors in mm."""
    columns = ("pose ANEES", "map ANEES", "NIS", "pose rms, mm", "pose sigma, mm", "line sigma, mm")
    table = Table("back end", *columns, "without a score", title=title, caption="mean (median) over the drives")
    for name, values in runs.items():
        sound = values[np.isfinite(values).all(axis=1)] * [1.0, 1.0, 1.0, 1e3, 1e3, 1e3]
        cells = [f"{each.mean():.3g} ({np.median(each):.3g})" for each in sound.T] if len(sound) else ["-"] * 6
        table.add_row(name, *cells, str(len(values) - len(sound)))
    plain_console(width=max(plain_console().width, 130)).print(table)


def rows_of(study: RivalStudy, task: tuple[str, int]) -> dict[Key, Scores]:
    """Make one drive and ride it with every back end; raises UsageError for a bad recording."""
    place, seed = task
    if place == PLACES[-1]:
        seen = drive(Loop(RING_M), seed)
    else:
        seen = observations_of(record(TrialConfig(place, study.driver, seed=seed), study.recordings), True)
    begin = drawn_start(seen.chance, seen.true_poses_world[0], study.p0)
    return {study.key(place, name, seed): scores(made(name, *begin, seen), seen) for name in study.backends}


def made(name: str, pose: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"], seen: DriveObservations) -> Backend:
    """Return a back end, or the ideal filter of this drive."""
    return IdealEkf(pose.copy(), cov.copy(), seen) if name == IDEAL else BACKENDS[name].make(pose.copy(), cov.copy())


class Listening:
    """A back end of which every scan's NIS is taken before it is told of it."""

    def __init__(self, backend: Backend) -> None:
        self.squared, self.dof = 0.0, 0
        self._backend = backend

    def __getattr__(self, name: str) -> object:
        return getattr(self._backend, name)

    def update(self, first: Observations, second: Observations) -> None:
        """Take the NIS, then let the back end take in the scan."""
        if len(second):
            ids, place = np.unique(second.ids, return_inverse=True)
            joint = self._backend.belief.joint(ids)
            means = joint.mean[POSE:].reshape(-1, 2)[place]
            model = stack(place, innovations(joint.mean[:POSE], joint.anchors[place], means, second.lines, second.cov))
            cov = joint.take(model.rows).cov
            self.squared += float(nis(model.e[None], (model.H @ cov @ model.H.T + model.R)[None])[0])
            self.dof += len(model.e)
        self._backend.update(first, second)


def scores(backend: Backend, seen: DriveObservations) -> Scores:
    """Return the scores of one ride; None where a covariance is none."""
    listening = Listening(backend)
    ridden: Ridden = ride(listening, seen)  # type: ignore[arg-type]
    off = ridden.estimated_world[:, :2] - ridden.true_poses_world[:, :2]
    rms = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    sigma = float(np.sqrt(np.mean(np.trace(ridden.estimated_cov[:, :2, :2], axis1=1, axis2=2))))
    line = float(np.median(np.sqrt(np.diag(ridden.joint.cov)[POSE + 1 :: 2])))
    try:
        rest = listening.squared / max(listening.dof, 1), rms, sigma, line
        return anees(ridden.pose_nees, 3), ridden.map_anees, *rest
    except np.linalg.LinAlgError:
        return None, None, None, rms, sigma, line


if __name__ == "__main__":
    run_study(RivalStudy)
