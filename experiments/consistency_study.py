"""How honest each back end is on the same recordings: ANEES of pose and map over many seeds, with intervals.

Each seed is explored once with `--driver`; the recording then goes through every back end, with the truth in place of
extraction and association or not. Seeds are the samples (steps of one run are nearly one draw): intervals are
bootstrapped over runs.
"""

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import tyro
from jaxtyping import Float
from rich.console import Console
from rich.progress import track
from rich.table import Table

from sim.replay import Recording
from slam.backends import BACKENDS

from .files import csv_bytes, write
from .replay import Association, RecordedRun, ReplayOptions, replay
from .scenario import P0, TrialConfig, UsageError, choose
from .trial import TrialResult, run_trial

COLUMNS = ("backend", "seed", "pose_anees", "pose_nees_in_band", "map_anees", "pose_rmse_m", "lines", "duplicate_lines")


@dataclass(frozen=True)
class Study:
    """Send recordings of many seeds through several back ends, and print how honest each is."""

    world: str = "paper-fig8"
    """A bundled world or a file."""
    seeds: int = 100
    """Recordings, with seeds 1 to this."""
    backends: tuple[str, ...] = tuple(BACKENDS)
    """The estimators."""
    p0: P0 = "small"
    """Covariance of the start."""
    association: Association = "true"
    """Whose matches: the back end's own gate, or the truth."""
    perfect_extraction: bool = True
    """True lines with noise drawn from exactly the stated covariance."""
    driver: str = "full-ekf"
    """The estimator that explored when the recordings were made."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/consistency.csv")
    """Where the table of all replays goes."""

    def run(self) -> None:
        """Run the study, print a row for each back end and write a row for each replay."""
        for name in (*self.backends, self.driver):
            choose("back end", name, BACKENDS)
        self.out.parent.mkdir(parents=True, exist_ok=True)
        with ProcessPoolExecutor(self.jobs) as pool:
            seeds = range(1, self.seeds + 1)
            found = pool.map(partial(_replays, self), seeds)
            rows = [row for rows in track(found, "replaying", len(seeds), console=Console(stderr=True)) for row in rows]
        write(self.out, csv_bytes(COLUMNS, rows))
        self._print(rows)

    def _print(self, rows: list[tuple[object, ...]]) -> None:
        extraction = "stated noise" if self.perfect_extraction else "real extraction"
        table = Table(
            title=f"{self.world}, P0 {self.p0}, {self.seeds} seeds, {self.association} association, {extraction}"
        )
        for name in ("back end", "pose ANEES", "95 % interval", "median", "in band", "map ANEES", "median", "failed"):
            table.add_column(name, justify="left" if name == "back end" else "right")
        for name in self.backends:
            mine = np.array([[np.nan if v is None else v for v in row[2:5]] for row in rows if row[0] == name], float)
            pose = mine[np.isfinite(mine[:, 0]), 0]
            if not len(pose):
                table.add_row(name, *["-"] * 6, str(self.seeds))
                continue
            low, high = bootstrap(pose)
            in_band, map_mean = np.nanmean(mine[:, 1:], axis=0)
            cells = (np.median(pose), in_band, map_mean, np.nanmedian(mine[:, 2]))
            words = [f"{value:.3f}" for value in cells]
            table.add_row(name, f"{pose.mean():.3f}", f"{low:.3f} to {high:.3f}", *words, str(self.seeds - len(pose)))
        Console().print(table)


def _replays(study: Study, seed: int) -> list[tuple[object, ...]]:
    """Record one seed and replay it with every back end."""
    made = run_trial(TrialConfig(study.world, study.driver, seed=seed, p0=study.p0))
    return list(_rows(study, recorded(made)))


def _rows(study: Study, run: RecordedRun) -> Iterator[tuple[object, ...]]:
    options = ReplayOptions(study.association, study.perfect_extraction)
    for name in study.backends:
        summary = replay(run, name, options).summary
        yield name, run.trial.seed, *(summary[key] for key in COLUMNS[2:])


def recorded(made: TrialResult) -> RecordedRun:
    """Return the recording that a trial left; raises UsageError where it ended before its first step."""
    log, scenario = made.log, made.scenario
    if log is None:
        raise UsageError(f"expected a run of at least one step, found none: {made.ending.reason}")
    recording = Recording(
        log.time_s, log.bearings_rad, log.ranges_m, log.sigma_m, log.range_max_m, log.odometry, log.odometry_cov
    )
    return RecordedRun(
        scenario.config, recording, scenario.start_estimate, scenario.start_cov, log.true_world, log.face_of_beam
    )


def bootstrap(values: Float[np.ndarray, " n"], draws: int = 2000, seed: int = 0) -> tuple[float, float]:
    """Return the 95 % interval of the mean, by resampling whole runs."""
    rng = np.random.default_rng(seed)
    means = rng.choice(values, (draws, len(values))).mean(axis=1)
    return float(np.quantile(means, 0.025)), float(np.quantile(means, 0.975))


if __name__ == "__main__":
    tyro.cli(Study).run()
