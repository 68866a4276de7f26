"""Where consistency ends: lost heading x loop length x strategy x back end, each explored by the strategy itself.

.venv/bin/python -m studies.consistency.heading      # goes on where it was interrupted
Rings of corridors around a block, with scans, noise, own association and the closed loop. Drawn as maps of ANEES.
"""

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from chainslam.experiments.artifacts.files import write
from chainslam.experiments.scenario import P0, TrialConfig, check
from chainslam.experiments.usage import UsageError, choose
from chainslam.sim.robot import RobotConfig
from chainslam.slam.backends import BACKENDS
from chainslam.viz.figures.anees_map import Field, anees_map
from chainslam.viz.figures.maps import saved

from ..exploration.ring_worlds import LEAST_M, ring_world
from ..runner.command import run_study
from ..runner.explored import explored
from ..runner.rows import Key, Row, key_of, read, rows_of
from ..runner.scores import interval_words

NAMES = ("length_m", "heading_deg", "p0", "strategy", "backend", "seed", "way")
KINDS: dict[str, Literal["png", "svg", "pdf"]] = {".png": "png", ".svg": "svg", ".pdf": "pdf"}


@dataclass(frozen=True)
class Ring:
    """One exploration: a ring, wheels, a strategy and a back end."""

    length_m: float
    heading_deg: float
    strategy: str
    backend: str
    seed: int


@dataclass(frozen=True)
class HeadingStudy:
    """Explore rings of several lengths with wheels of several kinds, and draw how honest each back end is."""

    backends: tuple[str, ...] = ("block-ekf", "full-ekf", "fej-ekf", "invariant-ekf", "graph")
    """The estimators."""
    strategies: tuple[str, ...] = ("nearest-robot", "nearest-start", "adaptive")
    """Names or schedules."""
    length_m: tuple[float, ...] = (30.0, 60.0)
    """Lengths of the ring."""
    heading_deg: tuple[float, ...] = (4.0,)
    """Standard deviations of the heading that the wheels lose in a metre; it grows with the square root."""
    way: float = 2.0
    """A run is stopped after so many times the length of its ring."""
    p0: P0 = "small"
    """Covariance of the start."""
    seeds: int = 10
    """Rings of each kind."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/heading.jsonl")
    """A line of JSON for each run; what it holds of the same code already is not run again."""
    picture: Path = Path("results/heading.png")
    """The maps; the suffix says which kind of file: png, svg or pdf."""
    only_report: bool = False
    """Draw and print what is there."""

    def run(self) -> None:
        """Run what is to be run, draw the maps and print them; raises UsageError."""
        choose("kind of picture", self.picture.suffix, KINDS)
        if min(self.length_m) < LEAST_M or min(self.heading_deg) <= 0.0 or self.way < 1.0 or self.seeds < 1:
            raise UsageError(
                f"expected rings of {LEAST_M:g} m or more, headings above 0, a way of 1 or more and a seed, found"
                f" {min(self.length_m):g}, {min(self.heading_deg):g}, {self.way:g}, {self.seeds}"
            )
        for name, strategy in itertools.product(self.backends, self.strategies):
            choose("back end", name, BACKENDS)
            check(self.trial(Ring(self.length_m[0], self.heading_deg[0], strategy, name, 1)))
        if self.only_report:
            self.report(read(self.out, NAMES))
            return
        tasks = [(ring, [key_of(self.row(ring), NAMES)]) for ring in self.rings()]
        self.report(list(rows_of(self.out, NAMES, tasks, functools.partial(_one_of, self), self.jobs)))

    def rings(self) -> list[Ring]:
        """Return the runs, seed by seed, so that what is there is balanced."""
        kinds = itertools.product(
            range(self.first_seed, self.first_seed + self.seeds),
            self.length_m,
            self.heading_deg,
            self.strategies,
            self.backends,
        )
        return [Ring(length, heading, strategy, name, seed) for seed, length, heading, strategy, name in kinds]

    def trial(self, ring: Ring) -> TrialConfig:
        """Return what one run is made of."""
        robot = RobotConfig()
        # Both wheels slip on their own, and turn the robot by the difference over the distance between them.
        slip = np.deg2rad(ring.heading_deg) * robot.wheels.base_m / np.sqrt(2.0)
        robot = replace(robot, wheels=replace(robot.wheels, slip=float(slip)))
        return TrialConfig(
            f"ring-{ring.length_m:g}", ring.backend, ring.strategy, ring.seed, self.p0,
            max_path_m=self.way * ring.length_m, robot=robot,
        )  # fmt: skip

    def row(self, ring: Ring) -> Row:
        """Return what a run's row is known by."""
        return vars(ring) | {"p0": self.p0, "way": self.way}

    def report(self, rows: Sequence[Row]) -> None:
        """Draw the maps and print every cell."""
        cells: dict[Key, list[Row]] = {}
        for row in rows:
            # A row of another way is another run.
            if row["way"] != self.way:
                continue
            cells.setdefault(key_of(row, NAMES[:5]), []).append(row)
        fields = [[self.field(cells, strategy, name) for name in self.backends] for strategy in self.strategies]
        across, along = ([f"{value:g}" for value in values] for values in (self.heading_deg, self.length_m))
        labels = (
            "heading lost by the wheels, degrees per root metre",
            "length of the ring, m; small: worst heading error on the way, median, and the runs",
        )
        self.picture.parent.mkdir(parents=True, exist_ok=True)
        write(self.picture, saved(anees_map(fields, across, along, labels), KINDS[self.picture.suffix]))
        print("median pose ANEES, mean (95 % interval); worst heading error on the way, degrees, median; walls entered")
        print("twice and returns, means; runs that closed every contour")
        for (length, heading, _, strategy, name), runs in sorted(cells.items()):
            print(f"{name}, {strategy}, {length:g} m, {heading:g}: {told(runs)}")

    def field(self, cells: Mapping[Key, Sequence[Row]], strategy: str, name: str) -> Field:
        """Return the map of one strategy with one back end."""
        anees, notes = np.full((len(self.heading_deg), len(self.length_m)), np.nan), []
        for row, heading in enumerate(self.heading_deg):
            line = []
            for column, length in enumerate(self.length_m):
                runs = cells.get((length, heading, self.p0, strategy, name), [])
                sound = _values(runs, "pose_anees")
                anees[row, column] = np.median(sound) if len(sound) else np.nan
                off = _values(runs, "heading_error_deg")
                line.append(f"{np.median(off):.1f}°, n {len(sound)}" if len(off) else "")
            notes.append(tuple(line))
        return Field(f"{name}\n{strategy}", anees, tuple(notes))


def told(runs: Sequence[Row]) -> str:
    """Return one cell in words."""
    anees, off = _values(runs, "pose_anees"), _values(runs, "heading_error_deg")
    if not len(anees):
        return f"{len(runs)} runs, none could be scored"
    closed = sum(run["contours_closed"] == run["contours_reachable"] for run in runs)
    doubles, returns = _values(runs, "double_entries"), _values(runs, "returns")
    means = ", ".join(f"{values.mean():.1f}" if len(values) else "-" for values in (doubles, returns))
    words = f"{np.median(anees):.2f}, {anees.mean():.2f} {interval_words(anees, 2)}; {np.median(off):.2f}; {means}"
    return f"{words}; {closed} of {len(runs)}"


def _values(runs: Sequence[Row], key: str) -> Float[np.ndarray, " n"]:
    return np.array([run[key] for run in runs if run.get(key) is not None], dtype=np.float64)


def _one_of(study: HeadingStudy, ring: Ring) -> list[Row]:
    return [study.row(ring) | explored(study.trial(ring), ring_world(ring.length_m, ring.seed))]


if __name__ == "__main__":
    run_study(HeadingStudy)
