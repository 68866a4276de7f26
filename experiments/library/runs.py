"""A run as an object over the files in its folder, whatever created them."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any, Literal, cast
from weakref import finalize

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.sim.logs.archive import regular
from chainslam.slam.geometry.lines import directions, normals

from ..artifacts.maps.map_files import read_map
from ..artifacts.maps.mapped import MappedCorners, read_corners
from ..artifacts.reading import told
from ..artifacts.results import SUMMARY
from ..artifacts.saved import read_summary
from ..artifacts.schema import UnfitError
from ..scoring.keys import Steps, Summary, Words
from ..scoring.maps.measurements import Measured
from ..usage import UsageError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REMEDY = "name a folder that explore or replay left"
BROKEN = "another table, or one that was cut short"
Picture = Literal["map", "visibility", "paths", "nees", "model", "traversals"]


class Home:
    """A temporary folder for results, deleted when nothing refers to it any more."""

    def __init__(self) -> None:
        self.folder = Path(mkdtemp(prefix="chainslam-"))
        finalize(self, rmtree, self.folder, True)


@dataclass(frozen=True)
class Map:
    """The final map of a run: n walls in the world frame."""

    ids: Int[np.ndarray, " n"]
    lines_world: Float[np.ndarray, "n 2"]
    """(alpha rad, r m) in Hessian form; the normal alpha points from the free side into the wall."""
    ends_world: Float[np.ndarray, "n 2 2"]
    """First and last point, m, with the free side on the left."""
    tentative: Bool[np.ndarray, " n"]
    """Which walls are not confirmed yet."""
    pose_world: Float[np.ndarray, 3]
    """Final pose of the robot: x m, y m, heading rad."""
    cov: Float[np.ndarray, "s s"]
    """Joint covariance of the pose and the lines (alpha, d) about their anchors, s = 3 + 2 n."""

    def __len__(self) -> int:
        return len(self.ids)

    def __repr__(self) -> str:
        metres = np.linalg.norm(self.ends_world[:, 1] - self.ends_world[:, 0], axis=1).sum()
        return f"Map({len(self)} walls of {metres:.1f} m in all, {np.count_nonzero(self.tentative)} of them tentative)"


@dataclass(frozen=True)
class Run:
    """A run, over the files in its folder; raises UsageError if one of them is missing or of another format."""

    folder: Path
    """Folder of its files; if `out` was not given they are deleted together with this object."""
    _home: Home | None = field(default=None, repr=False, compare=False)

    @cached_property
    def summary(self) -> Summary:
        """The scores, by the keys of `summary.json`."""
        return cast(Summary, read_summary(self.folder))

    @cached_property
    def steps(self) -> Steps:
        """An array for each column of `steps.csv`, with one entry for each step; `pandas.DataFrame` takes them all."""
        path = self.folder / "steps.csv"
        with told(path, REMEDY):
            kinds, columns = Steps.__annotations__, _columns(path)
            return cast(Steps, {name: _array(cells, kinds.get(name) == Words) for name, cells in columns.items()})

    @cached_property
    def map(self) -> Map:
        """The final map."""
        arrays = read_map(self.folder)
        alpha = arrays["lines"][:, 0]
        feet = arrays["anchors"] + arrays["lines"][:, 1:] * normals(alpha)
        ends = feet[:, None] + arrays["extents"][..., None] * directions(alpha)[:, None]
        return Map(arrays["ids"], arrays["lines_world"], ends, arrays["tentative"], arrays["pose"], arrays["cov"])

    def plot(self, picture: Picture = "map") -> Figure:
        """Return a matplotlib figure of the map, visibility graph, paths, NEES, model space or traversals.

        All but the first two need the truth, which is unknown for a real robot.
        """
        from ..views.pictures import figure_of

        return figure_of(self.folder, picture)

    def report(self) -> Path:
        """Write the page of `chainslam report` and return its path."""
        from .pages import report_at

        return report_at(self.folder)[1]

    def measure(self, first: int | None = None, second: int | None = None) -> Measured | MappedCorners:
        """Return the distance between two corners with its error; without arguments, all corners.

        Corners are given by their ids in `map.geojson`. Raises UsageError for another id, and for a corner whose walls
        lie on one line.
        """
        mapped = read_corners(self.folder)
        if first is None or second is None:
            return mapped
        return mapped.distance(*(mapped.named(str(corner), self.folder) for corner in (first, second)))

    def __repr__(self) -> str:
        said = self.summary
        return (
            f"Run({said['world']}, {said['backend']}, {said['strategy']}, seed {said['seed']}: {said['status']} after"
            f" {said['steps']} steps)"
        )

    def _repr_html_(self) -> str:
        """Return the floor plan, which a notebook shows."""
        plan = self.folder / "map.svg"
        return plan.read_text(encoding="utf-8") if plan.is_file() else f"<pre>{self!r}</pre>"


def table_at(path: Path) -> Any:
    """Return a CSV table as a pandas DataFrame, or as arrays by name without pandas; raises UsageError."""
    with told(path, REMEDY):
        try:
            import pandas
        except ImportError:
            return {name: _array(cells) for name, cells in _columns(path).items()}
        try:
            return pandas.read_csv(regular(path))
        except (ValueError, pandas.errors.ParserError) as error:
            raise UnfitError(BROKEN) from error


def _columns(path: Path) -> dict[str, tuple[str, ...]]:
    """Return the cells of a CSV table by column; raises UnfitError, OSError."""
    try:
        with regular(path).open(newline="", encoding="utf-8") as stream:
            names, *rows = csv.reader(stream)
        columns = zip(*rows, strict=True) if rows else ((),) * len(names)
        return dict(zip(names, columns, strict=True))
    except (ValueError, csv.Error) as error:
        raise UnfitError(BROKEN) from error


def _array(cells: Sequence[str], words: bool = False) -> np.ndarray:
    """Return a column as numbers, with NaN for an empty cell; as text where `words`, or if any is no number."""
    try:
        return np.array(cells, dtype=np.str_) if words else np.array([float(cell or "nan") for cell in cells])
    except ValueError:
        return np.array(cells)


def run_at(folder: Path) -> Run:
    """Return the run in a folder; raises UsageError if there is none."""
    if not (folder / SUMMARY).is_file():
        raise UsageError(f"expected a run's {SUMMARY}, found none in {folder}: {REMEDY}")
    run = Run(folder)
    _ = run.summary
    return run
