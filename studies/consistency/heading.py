"""Where consistency ends: heading uncertainty x loop length x back end, and what turning back to the start does to it.

Rings of corridors as in `loop_study`, with the true association and the stated noise; the last stretch before a ring
closes may show no walls, which is how the heading error of a robot that has walls passes a degree or two. A robot that
turns back to the start on its way, as `nearest-start` would, drives further. Drawn as maps of ANEES.
"""

import functools
import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import tyro
from jaxtyping import Float

from experiments.artifacts.files import write
from experiments.replays.corridor import Loop, drive
from experiments.scenario import P0, P0_SIGMAS
from experiments.usage import UsageError, choose
from slam.backends import BACKENDS
from viz.figures.anees_map import Field, anees_map
from viz.figures.maps import saved

from ..runner.scores import Key, Scores, bootstrap, fill
from .loops import ridden_scores

KEY = ("length_m", "heading_deg", "gap_m", "homings", "p0", "backend", "seed")
SCORES = ("pose_anees", "closed_pose_anees", "map_anees", "heading_error_deg", "lines")
KINDS: dict[str, Literal["png", "svg", "pdf"]] = {".png": "png", ".svg": "svg", ".pdf": "pdf"}


@dataclass(frozen=True)
class HeadingStudy:
    """Drive rings of several lengths with wheels of several kinds, and draw how honest each back end is."""

    backends: tuple[str, ...] = ("block-ekf", "full-ekf", "fej-ekf", "invariant-ekf", "graph")
    """The estimators."""
    length_m: tuple[float, ...] = (30.0, 60.0, 120.0, 240.0)
    """Lengths of the ring."""
    heading_deg: tuple[float, ...] = (0.3, 0.6, 1.2, 2.4)
    """Standard deviations of the heading that the wheels lose in a metre; it grows with the square root."""
    gap_share: float = 0.25
    """Share of the ring, its last stretch, in which nothing is seen."""
    homings: tuple[int, ...] = (0, 2)
    """How often the robot turns back to the start before it closes the ring."""
    p0: P0 = "small"
    """Covariance of the start."""
    seeds: int = 50
    """Rings of each kind, with seeds 1 to this."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/heading.jsonl")
    """Where each drive gets a row as soon as it is done; rows that are there already are not run again."""
    picture: Path = Path("results/heading.png")
    """The maps; the suffix says which kind of file: png, svg or pdf."""

    def run(self) -> None:
        """Run the study, write a row for each drive, draw the maps and print them; raises UsageError."""
        for name in self.backends:
            choose("back end", name, BACKENDS)
        choose("start covariance (--p0)", self.p0, P0_SIGMAS)
        choose("kind of picture", self.picture.suffix, KINDS)
        if min(self.length_m) < 20.0 or min(self.heading_deg) <= 0.0 or not 0.0 <= self.gap_share < 1.0:
            raise UsageError(
                "expected rings of 20 m or more, headings above 0 and a gap below 1, found"
                f" {min(self.length_m):g}, {min(self.heading_deg):g}, {self.gap_share:g}"
            )
        seeds = range(1, self.seeds + 1)
        kinds = list(itertools.product(self.length_m, self.heading_deg, self.homings))
        tasks = {
            (loop, seed): [self.key(loop, n, seed) for n in self.backends]
            for seed in seeds
            for loop in itertools.starmap(self.loop, kinds)
        }
        found = fill(self.out, (KEY, SCORES), tasks, functools.partial(rows_of, self), self.jobs)
        fields = [[self.field(found, name, homings) for name in self.backends] for homings in self.homings]
        rows, columns = ([f"{value:g}" for value in values] for values in (self.heading_deg, self.length_m))
        labels = (
            "heading lost by the wheels, degrees per root metre",
            "length of the ring, m; small figures: worst heading error on the way, median over the rings",
        )
        self.picture.parent.mkdir(parents=True, exist_ok=True)
        write(self.picture, saved(anees_map(fields, rows, columns, labels), KINDS[self.picture.suffix]))
        print(f"the last {self.gap_share:.0%} of the ring unseen, {self.seeds} rings each:")
        print("mean pose ANEES (95 % interval), median; worst heading error on the way, degrees, median")
        for homings, name in itertools.product(self.homings, self.backends):
            for length, heading in itertools.product(self.length_m, self.heading_deg):
                runs = self.runs(found, name, self.loop(length, heading, homings))
                print(f"{name}, {homings} times back, {length:g} m, {heading:g}: {told(runs)}")

    def loop(self, length_m: float, heading_deg: float, homings: int) -> Loop:
        """Return one kind of ring."""
        return Loop(length_m, heading_deg, self.gap_share * length_m, homings=homings)

    def key(self, loop: Loop, name: str, seed: int) -> Key:
        """Return the key of one drive's row."""
        numbers = str(loop.length_m), str(loop.heading_deg), str(loop.gap_m), str(loop.homings)
        return *numbers, self.p0, name, str(seed)

    def runs(self, found: dict[Key, Float[np.ndarray, " c"]], name: str, loop: Loop) -> Float[np.ndarray, "r c"]:
        """Return the scores of one cell, a row for each ring."""
        return np.array([found[self.key(loop, name, seed)] for seed in range(1, self.seeds + 1)])

    def field(self, found: dict[Key, Float[np.ndarray, " c"]], name: str, homings: int) -> Field:
        """Return the map of one back end."""
        anees, notes = np.full((len(self.heading_deg), len(self.length_m)), np.nan), []
        for row, heading in enumerate(self.heading_deg):
            line = []
            for column, length in enumerate(self.length_m):
                runs = self.runs(found, name, self.loop(length, heading, homings))
                sound = runs[np.isfinite(runs[:, 0])]
                anees[row, column] = sound[:, 0].mean() if len(sound) else np.nan
                broken = f", {len(runs) - len(sound)} broke" if len(sound) < len(runs) else ""
                line.append(f"{np.median(runs[:, 3]):.1f}°{broken}")
            notes.append(tuple(line))
        times = f", {homings} times back" if homings else ""
        return Field(f"{name}{times}", anees, tuple(notes))


def told(runs: Float[np.ndarray, "r c"]) -> str:
    """Return one cell in words."""
    values = runs[np.isfinite(runs[:, 0]), 0]
    if not len(values):
        return "broke down in every run"
    low, high = bootstrap(values)
    words = f"{values.mean():.2f} ({low:.2f} to {high:.2f}), {np.median(values):.2f}; {np.median(runs[:, 3]):.2f}"
    return words if len(values) == len(runs) else f"{words}; {len(runs) - len(values)} broke down"


def rows_of(study: HeadingStudy, task: tuple[Loop, int]) -> dict[Key, Scores]:
    """Make one ring and send its drive through every back end."""
    loop, seed = task
    seen = drive(loop, seed)
    return {study.key(loop, name, seed): ridden_scores(study.p0, name, loop, seed, seen) for name in study.backends}


if __name__ == "__main__":
    try:
        tyro.cli(HeadingStudy).run()
    except UsageError as error:
        raise SystemExit(f"heading_study: {error}") from error
