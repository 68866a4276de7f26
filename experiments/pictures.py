"""Pictures for papers from the folders that runs left: `python -m experiments.pictures DIR ... --out PICTURES`.

Paths and NEES of several folders (replays of one log) come together; the map, the model space and the traversals are of
the first.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro
from jaxtyping import Float
from matplotlib.figure import Figure

from viz import palette
from viz.figures import draw_map, saved
from viz.plots import draw_model_space, draw_nees, draw_trajectories, draw_traversal
from viz.shapes import hessian_cov

from .explore_command import prepare
from .files import write
from .results import LOG
from .saved import read_trial
from .saved_map import saved_map
from .scenario import TrialConfig, UsageError, load_world
from .scores import wheels_path
from .timelines import true_rings

BAD_USAGE = 2


@dataclass(frozen=True)
class Pictures:
    """Draw map, paths, NEES, model space and traversals of the runs in some folders."""

    runs: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="DIR")]
    """Folders of runs in one world."""
    out: Path
    """Folder for the pictures."""
    kinds: tuple[Literal["png", "svg", "pdf"], ...] = ("svg", "png")
    """Kinds of files."""

    def run(self) -> None:
        """Write the pictures; raises UsageError where a folder holds no run."""
        runs = [read_pictured(folder) for folder in self.runs]
        first = runs[0]
        shown = saved_map(self.runs[0], first.trial, first.log, first.walls, first.estimated_world)
        prepare(self.out)
        pictures: dict[str, Callable[[], Figure]] = {"map": lambda: draw_map(shown), **draw_all(runs)}
        for name, draw in pictures.items():
            figure = draw()
            for kind in self.kinds:
                write(self.out / f"{name}.{kind}", saved(figure, kind))


@dataclass(frozen=True)
class PicturedRun:
    """What pictures of a run are drawn from."""

    trial: TrialConfig
    log: dict[str, Any]
    walls: dict[str, Any]
    estimated_world: Float[np.ndarray, "s 3"]
    nees: Float[np.ndarray, " s"]


def read_pictured(folder: Path) -> PicturedRun:
    """Read a run's folder; raises UsageError where it holds none."""
    trial = read_trial(folder / "config.json")
    try:
        with np.load(folder / LOG) as log, np.load(folder / "map.npz") as walls:
            arrays, mapped = dict(log), dict(walls)
        columns = ("x_m", "y_m", "heading_rad", "pose_nees")
        with (folder / "steps.csv").open() as stream:
            header = stream.readline().strip().split(",")
            at = [header.index(name) for name in columns]
            table = np.genfromtxt(stream, delimiter=",", usecols=at, ndmin=2)
    except (OSError, ValueError, KeyError) as error:
        raise UsageError(f"expected a run's results in {folder}, found {error}: name what `explore` left") from error
    return PicturedRun(trial, arrays, mapped, table[:, :3], table[:, 3])


def draw_all(runs: list[PicturedRun]) -> dict[str, Callable[[], Figure]]:
    """Return, by name, what draws each picture of runs in one world; nothing for no run."""
    if not runs:
        return {}
    first = runs[0]
    trial = first.trial
    world = load_world(trial.world, trial.start, trial.scale)
    rings, title = true_rings(world), f"{world.name}, seed {trial.seed}"
    paths = {run.trial.backend: run.estimated_world for run in runs}
    lines = first.walls["lines_world"]
    count = len(lines)
    blocks = first.walls["cov"][3:, 3:].reshape(count, 2, count, 2)[np.arange(count), :, np.arange(count), :]
    covs = hessian_cov(lines[:, 0], first.walls["anchors"], blocks)
    true, wheels = first.log["true_poses"], wheels_path(first.log["true_poses"][0], first.log["odometry"])
    colours = [palette.of_backend(trial.backend)] * count
    return {
        "paths": lambda: draw_trajectories(true, paths, rings, f"{title}: paths, true and believed", wheels),
        "nees": lambda: draw_nees({run.trial.backend: run.nees for run in runs}, f"{title}: NEES of the pose"),
        "model": lambda: draw_model_space(lines, covs, colours, f"{title}, {trial.backend}"),
        "traversals": lambda: draw_traversal(true, rings, f"{title}: how often each stretch was driven"),
    }


def main() -> int:
    """Run the command and return its exit status."""
    try:
        tyro.cli(Pictures).run()
    except UsageError as error:
        print(f"pictures: {error}", file=sys.stderr)
        return BAD_USAGE
    return 0


if __name__ == "__main__":
    sys.exit(main())
