"""`chainslam explore`: one world, one robot, one map."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from .progress import print_summary, progress
from .results import write_results
from .scenario import P0, TrialConfig, UsageError, check, load_world
from .trial import run_trial


@dataclass(frozen=True)
class Explore:
    """Explore a world until every chain of walls is closed, and write the map beside how good it is."""

    world: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="WORLD")]
    """A name (see `chainslam worlds`) or a file: plan JSON, GeoJSON, SVG, a picture, a ROS map YAML."""
    backend: str = "full-ekf"
    """The estimator (see `chainslam backends`)."""
    strategy: str = "nearest-robot"
    """Which open end is visited next (see `chainslam strategies`)."""
    seed: int = 1
    """Decides all noise and the error of the first estimate; the same seed gives the same bytes."""
    p0: P0 = "small"
    """Covariance of the start: zero (0.1 mm, 1e-5 rad), small (0.01 m, 0.1 degree) or large (0.1 m, 2 degrees)."""
    errorless: bool = False
    """Exact ranges and wheels, the estimate started at the truth; the models keep the stated noise."""
    max_steps: int = 100_000
    """The run is stopped after this many scans."""
    start: tuple[float, ...] | None = None
    """Start pose instead of the drawing's own: x and y in metres, and perhaps the heading in rad."""
    scale: float | None = None
    """Metres per pixel or drawing unit, for files that do not say."""
    out: Path | None = None
    """Folder for the results; by default results/WORLD-BACKEND-STRATEGY-SEED."""

    @property
    def trial(self) -> TrialConfig:
        """What decides the run, without where its results go."""
        return TrialConfig(
            world=self.world,
            backend=self.backend,
            strategy=self.strategy,
            seed=self.seed,
            p0=self.p0,
            errorless=self.errorless,
            max_steps=self.max_steps,
            start=self.start,
            scale=self.scale,
        )

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        check(self.trial)
        world = load_world(self.world, self.start, self.scale)
        folder = self.out or default_folder(world.name, self.trial)
        prepare(folder)
        with progress(f"exploring {world.name}") as watch:
            result = run_trial(self.trial, watch, world)
        problems = write_results(result, folder)
        if self.out is None:
            _point_latest_at(folder)
        print_summary(result.summary)
        print(f"results in {folder}")
        if result.ending.exit_status:
            print(f"chainslam: {result.ending.status}: {result.ending.reason}", file=sys.stderr)
        for problem in problems:
            print(f"chainslam: not written: {problem}", file=sys.stderr)
        return result.ending.exit_status or (1 if problems else 0)


def default_folder(world: str, trial: TrialConfig) -> Path:
    """Return the folder for a run that names none: the same run comes to the same place."""
    parts = [world.replace(":", "-"), trial.backend, trial.strategy, str(trial.seed)]
    parts += [trial.p0] if trial.p0 != "small" else []
    parts += ["errorless"] if trial.errorless else []
    return Path("results") / "-".join(parts)


def prepare(folder: Path) -> None:
    """Make a folder that files can be written into; raises UsageError, before anything is computed, where it cannot."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"expected a folder for the results, found {folder} ({error.strerror}): name another with --out"
        ) from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"expected a folder to write into, found {folder} read-only: name another with --out")


def _point_latest_at(folder: Path) -> None:
    """Let results/latest lead to the newest run; file systems without links go without."""
    link = folder.parent / "latest"
    try:
        if link.is_symlink():
            link.unlink()
        link.symlink_to(folder.name, target_is_directory=True)
    except OSError:
        return
