"""The presence of bias: relocation against one joint update, with wheels or ranges that err in a way no model states.

The paper relocates first so that the bias of the wheels reaches the map less, and credits the scanner's precision with
its maps. One recording for each world, strategy and seed gets every fault in turn and goes through every back end, with
the true association or its own gate; runs are the samples.
"""

import functools
import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.campaign.scores.score import offsets, wall_errors
from chainslam.experiments.replays.observations import DriveObservations, observations_of, ride
from chainslam.experiments.replays.recordings import record
from chainslam.experiments.replays.replay import Association, RecordedRun, ReplayOptions, replay
from chainslam.experiments.scenario import TrialConfig, strategy_of
from chainslam.experiments.scoring.maps.coverage import alignment
from chainslam.experiments.scoring.trajectories import ate
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import choose
from chainslam.slam.backends import BACKENDS
from chainslam.slam.evaluation.consistency import anees
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import to_world

from ..runner.command import run_study
from ..runner.faults import Fault, faulty
from ..runner.scores import Key, Scores, fill, interval_words

KEY = ("world", "strategy", "fault", "size", "association", "backend", "seed")
SCORES = ("pose_anees", "map_anees", "ate_cm", "walls_cm", "shape_cm", "duplicate_lines", "false_matches")
SHOWN = ("pose ANEES", "map ANEES", "path, cm", "walls, cm", "shape of the map, cm")
BY_OWN_GATE = ("duplicate walls", "false matches")
RELOCATING = (("block-ekf", "joint-block-ekf"), ("relocation-ekf", "full-ekf"))
Kind = Literal["wheel-scale", "heading", "range", "range-noise"]


@dataclass(frozen=True)
class BiasStudy:
    """Send recordings with faults through several back ends, and print what each fault does to each."""

    world: str = "paper-fig8"
    """A bundled world or a file."""
    strategies: tuple[str, ...] = ("nearest-robot",)
    """Exploration strategies."""
    seeds: int = 20
    """Recordings."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    backends: tuple[str, ...] = ("block-ekf", "joint-block-ekf", "relocation-ekf", "full-ekf", "invariant-ekf")
    """The estimators."""
    faults: tuple[Kind, ...] = ("wheel-scale", "heading", "range", "range-noise")
    """Kinds of faults; a recording without any is always among them."""
    wheel_scale: tuple[float, ...] = (0.02, 0.05, 0.1)
    """Shares by which the wheels report too much."""
    heading_deg: tuple[float, ...] = (1.0, 3.0, 10.0)
    """Degrees of heading that the wheels gain in a metre."""
    range_m: tuple[float, ...] = (0.005, 0.01, 0.02, 0.04)
    """Metres by which all ranges are too long."""
    range_noise_m: tuple[float, ...] = (0.005, 0.01, 0.02, 0.04)
    """Standard deviations of a range, which the models are told."""
    association: Association = "true"
    """Whose matches: the back end's own gate, or the truth."""
    max_steps: int = 5000
    """A drive ends after this many scans."""
    driver: str = "full-ekf"
    """The estimator that explored when the recordings were made, without a fault."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/bias.jsonl")
    """Where each run gets a row as soon as it is done; rows that are there already are not run again."""
    recordings: Path = Path("results/recordings")
    """Where recordings are kept, so that later studies find them."""

    def run(self) -> None:
        """Run the study, write a row for each run and print one for each fault and back end; raises UsageError."""
        for name in (*self.backends, self.driver):
            choose("back end", name, BACKENDS)
        for strategy in self.strategies:
            strategy_of(strategy)
        kinds, seeds = self.chosen, range(self.first_seed, self.first_seed + self.seeds)
        tasks = {
            (strategy, seed): [self.key(strategy, fault, n, seed) for fault in kinds for n in self.backends]
            for strategy in self.strategies
            for seed in seeds
        }
        found = fill(self.out, (KEY, SCORES), tasks, functools.partial(rows_of, self), self.jobs)
        for strategy, (score, title) in itertools.product(self.strategies, enumerate(self.shown)):
            what = f"{title}: {self.world}, {strategy}, {self.association} association, {self.seeds} runs"
            table = Table("fault", *self.backends, *(f"{a} / {b}" for a, b in self.pairs), title=what)
            for fault in kinds:
                keys = {n: [self.key(strategy, fault, n, seed) for seed in seeds] for n in self.backends}
                values = {n: np.array([found[key][score] for key in keys[n]]) for n in self.backends}
                means = (f"{np.nanmean(column):.3g}" for column in values.values())
                table.add_row(fault.title, *means, *(ratio(values[a], values[b]) for a, b in self.pairs))
            plain_console(width=max(plain_console().width, 140)).print(table)

    @property
    def shown(self) -> tuple[str, ...]:
        """What is printed of the scores, in their order."""
        return SHOWN + (BY_OWN_GATE if self.association == "own" else ())

    @property
    def pairs(self) -> list[tuple[str, str]]:
        """Back ends that differ in nothing but relocating first."""
        return [pair for pair in RELOCATING if set(pair) <= set(self.backends)]

    @property
    def chosen(self) -> list[Fault]:
        """The faults of the study, none first."""
        sizes = {"wheel-scale": self.wheel_scale, "heading": self.heading_deg, "range": self.range_m}
        sizes |= {"range-noise": self.range_noise_m}
        return [Fault(), *(Fault(kind, size) for kind in self.faults for size in sizes[kind])]

    def key(self, strategy: str, fault: Fault, name: str, seed: int) -> Key:
        """Return the key of one run's row."""
        return self.world, strategy, fault.kind, str(float(fault.size)), self.association, name, str(seed)


def ratio(first: Float[np.ndarray, " r"], second: Float[np.ndarray, " r"]) -> str:
    """Return the geometric mean of the ratios of runs, with its 95 % interval; nothing where one has no logarithm."""
    if not (np.all(first > 0.0) and np.all(second > 0.0)):
        return ""
    logs = np.log(first / second)
    return f"{np.exp(logs.mean()):.2f} {interval_words(logs, 2, is_log=True)}"


def rows_of(study: BiasStudy, task: tuple[str, int]) -> dict[Key, Scores]:
    """Record one drive, or find its recording, and send it with every fault through every back end."""
    strategy, seed = task
    made = record(TrialConfig(study.world, study.driver, strategy, seed, max_steps=study.max_steps), study.recordings)
    rows: dict[Key, Scores] = {}
    for fault in study.chosen:
        run = faulty(made, fault)
        drive = observations_of(run, False) if study.association == "true" else None
        for name in study.backends:
            scores = _replayed(run, name) if drive is None else ridden_scores(run, name, drive)
            rows[study.key(strategy, fault, name, seed)] = scores
    return rows


def ridden_scores(run: RecordedRun, name: str, drive: DriveObservations) -> Scores:
    """Return the scores of a back end that is handed what was seen, wall by wall."""
    ridden = ride(BACKENDS[name].make(run.start_pose.copy(), run.start_cov.copy(), run.trial.backend_options), drive)
    to_true = alignment(run.start_pose, run.true_poses_world[0])
    lines, true = ridden.joint.mean[3:].reshape(-1, 2), ridden.true_lines_world
    feet = to_world(ridden.joint.anchors + lines[:, 1:] * normals(lines[:, 0]), to_true)
    walls, shape = offsets(feet[:, None], true)
    off = 100.0 * ate(ridden.estimated_world, ridden.true_poses_world), 100.0 * walls, 100.0 * shape
    try:
        return anees(ridden.pose_nees, 3), ridden.map_anees, *off, 0, 0
    except np.linalg.LinAlgError:
        return None, None, *off, 0, 0


def _replayed(run: RecordedRun, name: str) -> Scores:
    result = replay(run, name, ReplayOptions("own"))
    summary, log, last = result.summary, result.log, result.last
    if log is None or last is None:
        return (None,) * len(SCORES)
    walls, votes = last.map, result.votes
    among = ~walls.tentative & (votes.walls_of(walls.ids) >= 0)
    off = wall_errors(walls, votes, among, alignment(run.start_pose, run.true_poses_world[0]))
    return (
        summary["pose_anees"], summary["map_anees"], 100.0 * ate(log.estimated_world, log.true_world),
        *(None if value is None else 100.0 * value for value in off), summary["duplicate_lines"],
        summary["false_matches"],
    )  # fmt: skip


if __name__ == "__main__":
    run_study(BiasStudy)
