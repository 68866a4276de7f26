"""Do second looks know how wrong they are? Simulated drives, of which the truth is known, looked at again.

A drive goes by its scans, as a real robot's log does. Real walls are not straight, so each world also has walls that
bow: every metre or so a corner that is off the line. What the sightings of one such wall share, they do not state.

.venv/bin/python -m studies.logs.surveys --seeds 10     # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.artifacts.settings import record_of, trial_of
from chainslam.experiments.replays.paths.looked_again import surveyed
from chainslam.experiments.replays.real_log import REAL_WALLS
from chainslam.experiments.replays.recordings import recorded
from chainslam.experiments.scenario import TrialConfig, check, load_world
from chainslam.experiments.scoring.without_truth.normalised import normalised_path, normalised_relations
from chainslam.experiments.scoring.without_truth.references import References
from chainslam.experiments.scoring.without_truth.relations import Relations, between
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial
from chainslam.sim.worlds import World
from chainslam.slam.association.second_looks.second_looks import Survey
from chainslam.slam.association.second_looks.walls import inverse_at
from chainslam.slam.geometry.poses import rotation

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.tables import headed

ROWS = Path("studies/logs/surveys.jsonl")
NAMES = ("world", "bow_m", "seed")
PIECE_M = 1.0
"""A wall that bows has a corner about so often."""
EVERY = 5
"""Relations are told between one of so many poses ..."""
WAY_M = 5.0
"""... that are farther apart than this along the path."""
HEAD = (
    "world", "walls bow by, m", "runs", "poses: ANEES", "median", "in the 95 % band", "error, m rms", "stated, m",
    "relations: ANEES", "median", "in the 95 % band", "error, m rms", "stated, m",
)  # fmt: skip


@dataclass(frozen=True)
class SurveyStudy:
    """Explore each world with many seeds, look again, and print a row for each kind of walls."""

    worlds: tuple[str, ...] = ("paper-fig8", "rooms")
    """Bundled worlds or files."""
    bows: tuple[float, ...] = (0.0, 0.02)
    """How far corners of walls are off their line, sigma in metres; 0 for walls drawn with a ruler."""
    seeds: int = 10
    """Runs of each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    jobs: int = 1
    """Number of processes."""
    out: Path = ROWS
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        for world in self.worlds:
            check(TrialConfig(world))
        keys = [
            (world, bow, seed)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for world in self.worlds
            for bow in self.bows
        ]
        rows = list(rows_of(self.out, NAMES, [(key, [key]) for key in keys], _one, self.jobs))
        plain_console(width=170).print(table(rows))


def _one(key: tuple[str, float, int]) -> list[Row]:
    name, bow_m, seed = key
    config = TrialConfig(name, "invariant-ekf", seed=seed, odometry="scans")
    config = trial_of(record_of(config), REAL_WALLS)
    made = run_trial(config, world=bowed(load_world(name), bow_m, seed))
    assert made.log is not None
    recording = recorded(made).recording
    survey = surveyed([recording.scan(k) for k in range(len(recording))], made.log, config)
    kept = {"status": made.summary["status"], "steps": len(recording), "closures": survey.closures}
    return [dict(zip(NAMES, key, strict=True)) | kept | scores(survey, made.log.true_world)]


def bowed(world: World, bow_m: float, seed: int) -> World:
    """Return a world whose walls have a corner about every metre, off their line by so much (sigma)."""
    if bow_m == 0.0:
        return world
    chance = np.random.default_rng(seed)
    drawn = (world.free.exterior, *world.free.interiors)
    outer, *inner = [_bowed(shapely.get_coordinates(ring), bow_m, chance) for ring in drawn]
    return replace(world, free=shapely.Polygon(outer, inner))


def _bowed(ring: Float[np.ndarray, "n 2"], bow_m: float, chance: np.random.Generator) -> Float[np.ndarray, "m 2"]:
    points = []
    for begin, end in pairwise(ring):
        length = float(np.hypot(*(end - begin)))
        pieces = max(round(length / PIECE_M), 1)
        across = rotation(np.pi / 2) @ (end - begin) / length
        inner = np.arange(1, pieces)[:, None] / pieces
        points += [begin, *(begin + inner * (end - begin) + bow_m * chance.standard_normal((pieces - 1, 1)) * across)]
    return np.array(points)


def scores(survey: Survey, true_world: Float[np.ndarray, "s 3"]) -> dict[str, Any]:
    """Return the normalised errors of the poses, and of relations between them; both as seen from the first pose."""
    count = len(true_world)
    time_s = np.arange(float(count))
    cov = inverse_at(survey.information, np.arange(3 * count)).reshape(count, 3, count, 3)
    own = cov[np.arange(count), :, np.arange(count)]
    path = normalised_path(References(None, (time_s, true_world)), time_s, survey.poses, own)
    assert path is not None
    ways = np.append(0.0, np.cumsum(np.hypot(*np.diff(true_world[:, :2], axis=0).T)))
    # First poses are even and second ones odd, so that no three relations close a triangle.
    first, second = np.meshgrid(np.arange(0, count, 2 * EVERY), np.arange(EVERY, count, 2 * EVERY), indexing="ij")
    far = (ways[second] - ways[first] > WAY_M) & (first < second)
    first, second = first[far], second[far]

    true = Relations(time_s[first], time_s[second], between(true_world[first], true_world[second]))
    relations = normalised_relations(true, time_s, survey.poses, survey.pair_covs)
    return {"poses": path["all"], "relations": relations["all"]}


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each world and kind of walls: means over the runs, and the median run's median."""
    shown = headed("Second looks against the truth: 1 is honest, more is overconfident", HEAD)
    for world, bow_m in sorted({(row["world"], row["bow_m"]) for row in rows}):
        of = [row for row in rows if (row["world"], row["bow_m"]) == (world, bow_m)]
        shown.add_row(world, f"{bow_m:g}", str(len(of)), *_cells(of, "poses"), *_cells(of, "relations"))
    return shown


def _cells(rows: Sequence[Row], kind: str) -> list[str]:
    told = [row[kind] for row in rows if row[kind]["count"]]
    means = {name: float(np.mean([each[name] for each in told])) for name in ("anees", "in_band")}
    rms = {name: float(np.sqrt(np.mean([each[name] ** 2 for each in told]))) for name in ("error_m", "stated_m")}
    median = float(np.median([each["median"] for each in told]))
    return [
        f"{means['anees']:.2f}", f"{median:.2f}", f"{means['in_band']:.2f}",
        f"{rms['error_m']:.3f}", f"{rms['stated_m']:.3f}",
    ]  # fmt: skip


if __name__ == "__main__":
    run_study(SurveyStudy)
