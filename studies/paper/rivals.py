"""What does the shortcut cost, and is there an honest one? Every back end on the same drives.

Matches are true and noise is as stated. Drives of figures 8 and 9 are explored once with `--driver`; a ring of
corridors is driven without a mapper. The ideal EKF, whose Jacobians are at the truth, rides along. With `--plans` the
drives are of real plans, a plan each, and lines are those that the extraction finds.

.venv/bin/python -m studies.paper.rivals --seeds 20                                   # goes on where interrupted
.venv/bin/python -m studies.paper.rivals --plans ../shared/data/plans --driver invariant-ekf
"""

import functools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.replays.corridor import Loop, drive
from chainslam.experiments.replays.ideal import NAME as IDEAL
from chainslam.experiments.replays.ideal import IdealEkf
from chainslam.experiments.replays.observations import DriveObservations, Ridden, observations_of, ride
from chainslam.experiments.replays.recordings import record
from chainslam.experiments.scenario import KNOWN, P0, P0_SIGMAS, TrialConfig, drawn_start, sigmas_of
from chainslam.experiments.scoring.innovations import share_in_own_band
from chainslam.experiments.scoring.maps.measurements import Z_95
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError, choose
from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import POSE, Backend, Observations
from chainslam.slam.estimation.models import innovations, stack
from chainslam.slam.evaluation.consistency import anees, nis
from chainslam.slam.evaluation.from_start import FromStart, Start, from_start
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.robot import ScannerSpec

from ..runner.command import run_study
from ..runner.scores import Key, Scores, fill, precision

KEY = ("place", "p0", "backend", "seed")
SCORES = (
    *("pose_anees_from_start", "pose_anees", "map_anees", "nis", "nis_in_band", "held"),
    *("pose_rms_m", "pose_sigma_m"),
)
SHOWN = "from the start", "pose ANEES", "map ANEES", "NIS", "in band", "held", "rms, mm", "sigma, mm"
"""What the table calls them; error and sigma are of the position from the start."""
RINGS_M = {f"ring of {length:g} m": length for length in (60.0, 200.0)}
"""By their length."""
PLACES = ("paper-fig8", "paper-fig9", *RINGS_M)
MOST_STEPS = 3000
"""A drive stops here."""
EVERY = (*(name for name in BACKENDS if name != "graph-batch"), IDEAL)
"""What rides along; until the end `graph-batch` is `graph`."""


@dataclass(frozen=True)
class RivalStudy:
    """Ride the same drives with every back end, and print how honest and how precise each is."""

    places: tuple[str, ...] = PLACES
    """Where."""
    backends: tuple[str, ...] = EVERY
    """The estimators."""
    plans: Path | None = None
    """Folder of plan files, which take the place of those places."""
    every: int = 4
    """Every so many plans by name, one drive in each."""
    pattern: str = "lifull_*.json"
    """Which files of the folder."""
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
        drives = self.drives()
        tasks = {each: [self.key(*each, name) for name in self.backends] for own in drives.values() for each in own}
        found = fill(self.out, (KEY, SCORES), tasks, functools.partial(rows_of, self), self.jobs)
        for words, own in drives.items():
            runs = {name: np.array([found[self.key(*each, name)] for each in own]) for name in self.backends}
            show(f"{words}, P0 {self.p0}, true matches, drives: {len(own)}, from seed {self.first_seed}", runs)

    def drives(self) -> dict[str, list[tuple[str, int]]]:
        """Return the drives (place, seed) of each table; raises UsageError for a folder without plans."""
        if self.plans is None:
            seeds = range(self.first_seed, self.first_seed + self.seeds)
            return {place: [(place, seed) for seed in seeds] for place in self.places}
        found = sorted(self.plans.glob(self.pattern))[:: self.every]
        if not found:
            raise UsageError(f"expected plan files in {self.plans}, found no {self.pattern}: name their folder")
        return {f"{len(found)} plans": [(str(plan), self.first_seed) for plan in found]}

    def key(self, place: str, seed: int, name: str) -> Key:
        """Return the key of one ride's row."""
        return Path(place).stem, self.p0, name, str(seed)


def show(title: str, runs: dict[str, Float[np.ndarray, "r c"]]) -> None:
    """Print the mean of each score over the drives and, in brackets, its median; sigmas and errors in mm."""
    table = Table("back end", *SHOWN, "without a score", title=title, caption="mean (median) over the drives")
    in_mm = np.where([name.endswith("_m") for name in SCORES], 1e3, 1.0)
    for name, values in runs.items():
        sound = values[np.isfinite(values).all(axis=1)] * in_mm
        cells = [f"{each.mean():.3g} ({np.median(each):.3g})" for each in sound.T] if len(sound) else ["-"] * len(SHOWN)
        table.add_row(name, *cells, str(len(values) - len(sound)))
    plain_console(width=max(plain_console().width, 130)).print(table)


def rows_of(study: RivalStudy, task: tuple[str, int]) -> dict[Key, Scores]:
    """Make one drive and ride it with every back end; raises UsageError for a bad recording."""
    place, seed = task
    if place in RINGS_M:
        seen = drive(Loop(RINGS_M[place]), seed)
    else:
        trial = TrialConfig(place, study.driver, seed=seed, max_steps=MOST_STEPS)
        seen = observations_of(record(trial, study.recordings), study.plans is None)
    return {study.key(*task, name): scores(*made(name, study.p0, seen), seen) for name in study.backends}


def made(name: str, p0: P0, seen: DriveObservations) -> tuple[Backend, FromStart]:
    """Return a back end, or the ideal filter of this drive, at its start, and what tells its pose from there."""
    true = seen.true_poses_world[0]
    start = Start(*drawn_start(seen.chance, true, p0), true)

    def make(pose: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> Backend:
        return IdealEkf(pose.copy(), cov.copy(), seen) if name == IDEAL else entry.make(pose.copy(), cov.copy())

    entry = BACKENDS["full-ekf" if name == IDEAL else name]
    backend, carries = make(start.estimate_world, start.cov), entry.carries_start
    return backend, from_start(backend, carries, start, start.known(sigmas_of(KNOWN)), make, ScannerSpec())


class Listening:
    """A back end of which every scan's NIS is taken before it is told of it."""

    def __init__(self, backend: Backend) -> None:
        self.values: list[float] = []
        """NIS of each scan that showed a known wall."""
        self.dofs: list[int] = []
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
            self.values.append(float(nis(model.e[None], (model.H @ cov @ model.H.T + model.R)[None])[0]))
            self.dofs.append(len(model.e))
        self._backend.update(first, second)

    def told(self) -> tuple[float, float]:
        """Return the NIS over its degrees of freedom, and the share of scans in the 95 % band of their own."""
        return float(np.sum(self.values) / np.sum(self.dofs)), share_in_own_band(self.values, self.dofs)


def scores(backend: Backend, tells: FromStart, seen: DriveObservations) -> Scores:
    """Return the scores of one ride; None where a covariance is none.

    `held` is the share of the 95 % intervals of x, y and the heading, step by step, that hold the truth.
    """
    listening = Listening(backend)
    ridden: Ridden = ride(listening, seen, tells)  # type: ignore[arg-type]
    rms, sigma = precision(ridden.from_start_world, ridden.from_start_cov, ridden.true_poses_world)
    error = ridden.estimated_world - ridden.true_poses_world
    error[:, 2] = wrap(error[:, 2])
    held = float(np.mean(np.abs(error) <= Z_95 * np.sqrt(np.diagonal(ridden.estimated_cov, axis1=1, axis2=2))))
    try:
        honest = anees(ridden.pose_nees_from_start, 3), anees(ridden.pose_nees, 3), ridden.map_anees
        return *honest, *listening.told(), held, rms, sigma
    except np.linalg.LinAlgError:
        return None, None, None, None, None, held, rms, sigma


if __name__ == "__main__":
    run_study(RivalStudy)
