"""Pictures for papers from the folders of runs.

`python -m chainslam.experiments.views.pictures DIR ... --out PICTURES`: paths and NEES of several folders (replays of
one log) are drawn together; the map, the visibility graph, the model space and the traversals are those of the first.
"""

import csv
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import tyro
from jaxtyping import Float
from matplotlib.figure import Figure
from PIL import Image

from chainslam.sim.logs.archive import regular
from chainslam.sim.logs.recorded_robot import MOST_M, read_log, within
from chainslam.slam.evaluation.consistency import chi2_band
from chainslam.viz import palette
from chainslam.viz.figures.maps import Picture, draw_map, saved
from chainslam.viz.figures.plots import NeesCurve, draw_model_space, draw_nees, draw_trajectories, draw_traversal
from chainslam.viz.figures.visibility import draw_graph
from chainslam.viz.shapes import hessian_cov

from ..artifacts.files import write
from ..artifacts.maps.map_files import read_map
from ..artifacts.maps.picture import graph_picture
from ..artifacts.maps.visibility import VISIBILITY, read_visibility
from ..artifacts.reading import told
from ..artifacts.results import LOG
from ..artifacts.run_folder import prepare
from ..artifacts.saved import REMEDY
from ..artifacts.schema import UnfitError
from ..replays.replay import read_run
from ..scenario import TrialConfig, load_world
from ..scoring.summary import odometry_poses
from ..terminal.console import say
from ..usage import UsageError, choose
from .saved_map import saved_map
from .timelines import true_rings

BAD_USAGE = 2
POSE_DOF = 3


@dataclass(frozen=True)
class Pictures:
    """Draw map, visibility graph, paths, NEES, model space and traversals of the runs in some folders."""

    runs: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="DIR")]
    """Folders of runs in one world."""
    out: Path
    """Folder for the pictures."""
    kinds: tuple[Literal["png", "svg", "pdf"], ...] = ("svg", "png")
    """File formats."""

    def run(self) -> None:
        """Write the pictures; raises UsageError for a folder without a run."""
        runs = [read_pictured(folder) for folder in self.runs]
        first = runs[0]
        shown = saved_map(self.runs[0], first.trial, first.log, first.walls, first.estimated_world)
        prepare(self.out)
        pictures = {**draw_maps(self.runs[0], shown), **draw_all(runs)}
        if "visibility" not in pictures:
            say(f"pictures: no {VISIBILITY} in {self.runs[0]}, an older run: its graph is not drawn", stderr=True)
        for name, draw in pictures.items():
            figure = draw()
            for kind in self.kinds:
                write(self.out / f"{name}.{kind}", saved(figure, kind))


@dataclass(frozen=True)
class PicturedRun:
    """The data for pictures of a run."""

    trial: TrialConfig
    log: dict[str, Any]
    walls: dict[str, Any]
    estimated_world: Float[np.ndarray, "s 3"]
    nees: Float[np.ndarray, " s"]
    path_m: Float[np.ndarray, " s"]


def read_pictured(folder: Path) -> PicturedRun:
    """Read a run's folder; raises UsageError if it contains none."""
    run = read_run(folder / LOG)
    walls, steps = read_map(folder), read_steps(folder)
    if len(steps) != len(run.recording):
        raise UsageError(
            f"expected a step for each of {len(run.recording)} scans, found {len(steps)} in {folder / 'steps.csv'}:"
            " keep a run's files together"
        )
    arrays = {"true_poses": run.true_poses_world, "start_pose": run.start_pose, "odometry": run.recording.odometry}
    return PicturedRun(run.trial, arrays, walls, steps[:, :3], steps[:, 3], steps[:, 4])


def read_steps(folder: Path) -> Float[np.ndarray, "s 5"]:
    """Return estimated poses (m, m, rad), the NEES of the pose and path lengths (m) from `steps.csv`.

    The NEES is that of the pose relative to the start, and of an older run without it the pose's own. Raises
    UsageError.
    """
    path, columns = folder / "steps.csv", ("x_m", "y_m", "heading_rad")
    with told(path, REMEDY):
        try:
            with regular(path).open(newline="", encoding="utf-8") as stream:
                table = csv.DictReader(stream)
                nees = "pose_nees_from_start" if "pose_nees_from_start" in (table.fieldnames or ()) else "pose_nees"
                rows = [[float(row[name] or "nan") for name in (*columns, nees, "path_length_m")] for row in table]
        except (ValueError, KeyError, TypeError, csv.Error) as error:
            raise UnfitError("another table, or one that was cut short") from error
        steps = np.array(rows, dtype=np.float64).reshape(-1, len(columns) + 2)
        if not within(steps[:, :3], MOST_M):
            raise UnfitError(f"poses that are NaN or beyond {MOST_M:g} m")
    return steps


def draw_all(runs: Sequence[PicturedRun]) -> dict[str, Callable[[], Figure]]:
    """Return, by name, what draws each picture of runs in one world; nothing for no run."""
    if not runs:
        return {}
    first = runs[0]
    trial = first.trial
    world = load_world(trial.world, trial.start, trial.drawing)
    rings, title = true_rings(world), f"{world.name}, seed {trial.seed}"
    paths = {run.trial.backend: run.estimated_world for run in runs}
    lines = first.walls["lines_world"]
    count = len(lines)
    blocks = first.walls["cov"][3:, 3:].reshape(count, 2, count, 2)[np.arange(count), :, np.arange(count), :]
    covs = hessian_cov(lines[:, 0], first.walls["anchors"], blocks)
    true, wheels = first.log["true_poses"], odometry_poses(first.log["true_poses"][0], first.log["odometry"])
    colours = [palette.of_backend(trial.backend)] * count
    return {
        "paths": lambda: draw_trajectories(true, paths, rings, f"{title}: paths, true and estimated", wheels),
        "nees": lambda: draw_nees([_curve(run) for run in runs]),
        "model": lambda: draw_model_space(lines, covs, colours, f"{title}, {trial.backend}"),
        "traversals": lambda: draw_traversal(true, rings, f"{title}: how often each stretch was driven"),
    }


def _curve(run: PicturedRun) -> NeesCurve:
    band = np.tile(np.array(chi2_band(POSE_DOF))[:, None], len(run.nees))
    return NeesCurve(run.trial.backend, run.path_m, run.nees, band)


def draw_maps(folder: Path, shown: Picture) -> dict[str, Callable[[], Figure]]:
    """Return, by name, what draws the map of a run and its visibility graph, which runs of older versions lack."""
    pictures: dict[str, Callable[[], Figure]] = {"map": lambda: draw_map(shown)}
    if (folder / VISIBILITY).is_file():
        graph, route = read_visibility(folder, shown.map.ids)
        pictures["visibility"] = lambda: draw_graph(graph_picture(shown, graph, route))
    return pictures


def figure_of(folder: Path, name: str) -> Figure:
    """Return one picture of a run; raises UsageError for a name that is none, or where the files do not tell it."""
    with told(folder / LOG, REMEDY):
        is_witnessed = "true_poses" in read_log(folder / LOG)
    if not is_witnessed:
        return _as_written(folder, name)
    run = read_pictured(folder)
    shown = saved_map(folder, run.trial, run.log, run.walls, run.estimated_world)
    pictures: dict[str, Callable[[], Figure]] = {**draw_maps(folder, shown), **draw_all([run])}
    return pictures[choose("picture", name, pictures)]()


def _as_written(folder: Path, name: str) -> Figure:
    """Return a stored picture of a drive without ground truth; raises UsageError for one that needs the truth."""
    path = folder / f"{choose('picture of a drive whose truth nobody knows', name, ('map', 'visibility'))}.png"
    with told(path, REMEDY), Image.open(regular(path)) as image:
        figure = Figure(figsize=(image.width / 150, image.height / 150), dpi=150)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.imshow(np.asarray(image))
        axes.set_axis_off()
    return figure


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
