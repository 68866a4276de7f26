"""A trajectory with the covariances that its estimator states, as text: TUM, CSV, or the folder of a run."""

import csv
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from chainslam.sim.logs.recorded_robot import MOST_M
from chainslam.slam.geometry.poses import wrap

from ....artifacts.saved import read_summary
from ....scoring.without_truth.references import lines_of
from ....usage import UsageError
from ..draws import Cross
from ..geometry.plane import Frame

Space = Literal["plane", "space"]
PairCovs = Callable[[Int[np.ndarray, " m"], Int[np.ndarray, " m"]], Float[np.ndarray, "m e e"]]
"""Joint covariances of two poses, e = 6 in the plane and 12 in space, given their rows."""
PLANE_TO_SPACE = (0, 1, 5)
"""Rows of x, y and yaw in the order of ROS: x y z roll pitch yaw."""
UNIT = 0.02
"""Largest difference of a quaternion's length from 1."""
TRUTH = "trajectory_true.tum"
"""The true poses in the folder of a run."""
TILTED = "the robot tilts, and only x, y and yaw are audited"
SWAPPED = "the quaternions would not tilt in the order w x y z: is qw their first column?"
TILTED_RAD = 0.2
"""A robot that is tilted by more does not move in the plane."""
IN_SPACE = 7
"""Numbers of a pose in space."""
TUM, PLANAR = 8, 4
WIDTHS = {0: 0, 6: 3, 9: 3, 21: 6, 36: 6}
"""Columns behind a pose, upper triangle or full matrix, and the size of the covariance."""
FORMATS = (
    "t x y z qx qy qz qw (TUM) or t x y theta, each with 6 more columns xx xy xt yy yt tt, or 21 of a 6 x 6 covariance"
)
NAMES = {
    "t": ("time", "time_s", "t", "timestamp", "stamp", "sec", "seconds"),
    "x": ("x", "x_m", "px", "tx", "pose_x", "position_x"),
    "y": ("y", "y_m", "py", "ty", "pose_y", "position_y"),
    "z": ("z", "z_m", "pz", "tz", "pose_z", "position_z"),
    "theta": ("theta", "theta_rad", "heading", "heading_rad", "yaw", "yaw_rad", "th", "phi"),
    **{name: (name, f"orientation_{name[1]}") for name in ("qx", "qy", "qz", "qw")},
}
"""Names of CSV columns."""
AXIS = "(x|y|z|roll|pitch|t|th|theta|yaw|heading)"
COV = re.compile(rf"(?:cov|p|c)?_?{AXIS}_?{AXIS}")
AXES = {"x": 0, "y": 1, "z": 2, "roll": 3, "pitch": 4}
"""Places in the order of ROS; all others are the yaw."""


@dataclass(frozen=True)
class Stated:
    """A trajectory of n poses."""

    name: str
    time_s: Float[np.ndarray, " n"]
    poses_world: Float[np.ndarray, "n p"]
    """x m, y m, heading rad; in space x y z qx qy qz qw."""
    covs: Float[np.ndarray, "n d d"] | None = None
    """Of (x, y, heading), or of x y z roll pitch yaw; None for a truth."""
    notes: tuple[str, ...] = ()
    """What was assumed, in words."""
    frame: Frame | None = None
    """The frame of the errors, if the file tells it."""
    held: int | None = None
    """Row of the pose that is the frame of the others, and known in it."""
    pair_covs: PairCovs | None = None
    """The joint covariance of two poses, each in its body frame, given their rows."""
    cross_covs: Cross | None = None
    """The covariances of all poses with some, each in its body frame, given the rows of these."""
    truth: Path | None = None
    """The truth in the same folder."""
    estimator: str | None = None
    """The back end of a run of ours."""
    anees_from_start: float | None = None
    """The ANEES relative to the start, as the run itself has it."""
    spatial: Float[np.ndarray, "n 7"] | None = None
    """The poses in space, x y z qx qy qz qw, if the file has them."""

    @property
    def used_covs(self) -> Float[np.ndarray, "n d d"] | None:
        """The covariances of the axes that are audited: x, y and heading, or all six."""
        if self.covs is None or self.covs.shape[1] == 3 or self.poses_world.shape[1] == IN_SPACE:
            return self.covs
        return np.asarray(self.covs[:, PLANE_TO_SPACE][:, :, PLANE_TO_SPACE])

    def cross_at(self, rows: Int[np.ndarray, " m"]) -> Cross | None:
        """Return the covariances of the poses of some rows with each other, if they are known."""
        of_poses = self.cross_covs
        return None if of_poses is None else lambda some: of_poses(rows[some])[rows]


def in_space(stated: Stated, needs_covariance: bool = True) -> Stated:
    """Return a trajectory with its poses in space; raises UsageError if its file has not all six axes."""
    name, poses = stated.name, stated.spatial
    if poses is None:
        raise UsageError(
            f"expected x y z qx qy qz qw in {name} for --space space, found poses in the plane: leave --space out"
        )
    if not np.all(np.abs(poses[:, :3]) <= MOST_M):
        raise UsageError(f"expected positions within {MOST_M:g} m in {name}, found others in z: correct it")
    if needs_covariance and (stated.covs is None or stated.covs.shape[1] != 6):
        found = "none" if stated.covs is None else "those of x, y and heading"
        raise UsageError(
            f"expected covariances of x y z roll pitch yaw in {name}, found {found}: append their 21 columns, the upper"
            " triangle"
        )
    return replace(stated, poses_world=poses, notes=tuple(note for note in stated.notes if note != TILTED))


def read_folder(folder: Path) -> Stated:
    """Read the poses, covariances and truth of a run of ours; raises UsageError."""
    if not (folder / "steps.csv").is_file():
        raise UsageError(
            f"expected a trajectory, found {folder} without steps.csv or a bag's metadata.yaml: name a file, the folder"
            " of a run, or a bag"
        )
    summary, truth = read_summary(folder), folder / TRUTH
    return replace(
        read_text(folder / "steps.csv"),
        name=folder.resolve().name,
        truth=truth if truth.is_file() else None,
        estimator=str(summary["backend"]),
        anees_from_start=summary.get("pose_anees_from_start"),
    )


def read_text(path: Path) -> Stated:
    """Read a trajectory in the TUM format, as `t x y theta`, or as CSV with a header; raises UsageError."""
    header, rows = table(path)
    if header is None:
        time_s, poses, covs, notes, spatial = _by_place(path, rows)
    else:
        time_s, poses, covs, notes, spatial = _by_name(path, header, rows)
    if not np.all(np.isfinite(time_s)) or not np.all(np.isfinite(poses)) or np.abs(poses[:, :2]).max() > MOST_M:
        at = int(np.flatnonzero(~np.isfinite(time_s) | ~np.all(np.isfinite(poses), axis=1)).min(initial=len(rows)))
        where = f"in row {at + 1}" if at < len(rows) else f"beyond {MOST_M:g} m"
        raise UsageError(f"expected times and poses that are numbers, found others {where} of {path}: correct it")
    order = np.argsort(time_s, kind="stable")
    if np.any(np.diff(order) < 0):
        notes = (*notes, "its rows were sorted by time")
    covs, spatial = (None if each is None else each[order] for each in (covs, spatial))
    return Stated(path.name, time_s[order], poses[order], covs, notes, spatial=spatial)


Columns = tuple[
    Float[np.ndarray, " n"], Float[np.ndarray, "n 3"], Float[np.ndarray, "n d d"] | None, tuple[str, ...],
    Float[np.ndarray, "n 7"] | None,
]  # fmt: skip


def _by_place(path: Path, rows: Float[np.ndarray, "n w"]) -> Columns:
    width = rows.shape[1]
    first = TUM if width - TUM in WIDTHS else PLANAR
    if width - first not in WIDTHS:
        raise UsageError(f"expected {FORMATS}, found {width} columns in {path}: correct it")
    notes: tuple[str, ...] = ()
    if first == PLANAR:
        heading = _in_radians(rows[:, 3], path)
    else:
        heading, notes = heading_of(rows[:, 4:8], path)
    size = WIDTHS[width - first]
    covs = symmetric(rows[:, first:], size) if size else None
    spatial = rows[:, 1:8] if first == TUM else None
    return rows[:, 0], np.column_stack([rows[:, 1:3], heading]), covs, notes, spatial


def _by_name(path: Path, header: Sequence[str], rows: Float[np.ndarray, "n w"]) -> Columns:
    names = [word.strip().strip('"').lower() for word in header]
    known = {key: names.index(found) for key, words in NAMES.items() if (found := _first(words, names)) is not None}
    missing = [key for key in ("t", "x", "y") if key not in known]
    if missing or ("theta" not in known and not {"qz", "qw"} <= set(known)):
        raise UsageError(
            f"expected columns t, x, y and theta (or qx qy qz qw) in {path}, found {', '.join(names[:12])}: rename them"
        )
    notes: tuple[str, ...] = ()
    if "theta" in known:
        heading = _in_radians(rows[:, known["theta"]], path)
    else:
        parts = [rows[:, known[q]] if q in known else np.zeros(len(rows)) for q in ("qx", "qy", "qz", "qw")]
        heading, notes = heading_of(np.stack(parts, axis=1), path)
    cells = {pair: k for k, name in enumerate(names) if (pair := _pair(name)) is not None and k not in known.values()}
    poses = np.column_stack([rows[:, known["x"]], rows[:, known["y"]], heading])
    every = ("x", "y", "z", "qx", "qy", "qz", "qw")
    spatial = rows[:, [known[key] for key in every]] if set(every) <= set(known) else None
    given = [axis for axis in range(6) if (axis, axis) in cells]
    if not set(PLANE_TO_SPACE) <= set(given):
        return rows[:, known["t"]], poses, None, notes, spatial
    axes = list(range(6)) if len(given) == 6 else list(PLANE_TO_SPACE)
    covs, upper = np.zeros((len(rows), len(axes), len(axes))), np.triu_indices(len(axes))
    named = [(i, j, cells[axes[i], axes[j]]) for i, j in zip(*upper, strict=True) if (axes[i], axes[j]) in cells]
    for i, j, k in named:
        covs[:, i, j] = covs[:, j, i] = rows[:, k]
    if len(named) < len(upper[0]):
        notes = (*notes, "correlations without a column count as 0")
    return rows[:, known["t"]], poses, covs, notes, spatial


def _first(words: Sequence[str], names: Sequence[str]) -> str | None:
    return next((word for word in words if word in names), None)


def _pair(name: str) -> tuple[int, int] | None:
    """Return the row and column of a covariance that a column is named after."""
    found = COV.fullmatch(name)
    if found is None:
        return None
    i, j = (AXES.get(axis, 5) for axis in found.groups())
    return min(i, j), max(i, j)


def symmetric(cells: Float[np.ndarray, "n w"], size: int) -> Float[np.ndarray, "n d d"]:
    """Return matrices from their upper triangles, row by row, or from all their cells."""
    if cells.shape[1] == size * size:
        return np.asarray(cells.reshape(-1, size, size))
    covs = np.zeros((len(cells), size, size))
    upper = np.triu_indices(size)
    covs[:, upper[0], upper[1]] = covs[:, upper[1], upper[0]] = cells
    return covs


def unit(q: Float[np.ndarray, "n 4"], path: Path, of: str = "row") -> Float[np.ndarray, "n 4"]:
    """Return quaternions made unit; raises UsageError, which names the row, where they are far from it."""
    length = np.linalg.norm(np.clip(q, -9.0, 9.0), axis=1)  # beyond, its square may be infinite
    if np.any(bad := ~(np.abs(length - 1.0) < UNIT)):
        raise UsageError(
            f"expected unit quaternions qx qy qz qw in {path}, found one of length {length[bad][0]:.3g} in {of}"
            f" {np.flatnonzero(bad)[0] + 1}: correct it"
        )
    return np.asarray(q / length[:, None])


def heading_of(q: Float[np.ndarray, "n 4"], path: Path) -> tuple[Float[np.ndarray, " n"], tuple[str, ...]]:
    """Return the yaw of quaternions (x, y, z, w), with a note where they are tilted; raises UsageError."""
    x, y, z, w = unit(q, path).T
    notes: tuple[str, ...] = (TILTED,) if _tilt(x, y) > TILTED_RAD else ()
    notes += (SWAPPED,) if notes and _tilt(y, z) <= TILTED_RAD else ()
    return np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2)), notes


def _tilt(x: Float[np.ndarray, " n"], y: Float[np.ndarray, " n"]) -> float:
    """Return the largest tilt, rad, of unit quaternions."""
    return float(np.arccos(np.clip(1.0 - 2.0 * (x**2 + y**2), -1.0, 1.0)).max())


def _in_radians(heading: Float[np.ndarray, " n"], path: Path) -> Float[np.ndarray, " n"]:
    # Nobody winds up so far in steps that never come near a whole turn.
    if np.abs(heading).max(initial=0.0) > 2.0 * np.pi and np.abs(np.diff(heading)).max(initial=0.0) > 2.0 * np.pi + 0.5:
        raise UsageError(f"expected headings in radians in {path}, found {np.abs(heading).max():.4g}: degrees?")
    return np.asarray(wrap(heading))


def table(path: Path) -> tuple[list[str] | None, Float[np.ndarray, "n w"]]:
    """Return the header of a text file, if it has one, and its numbers; raises UsageError."""
    what = f"a trajectory ({FORMATS}; or CSV with named columns)"
    lines = lines_of(path, what)
    header: list[str] | None = None
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip()[0] in "#%":
            continue
        words = next(csv.reader([line])) if "," in line else line.split()
        numbers = [_number(word) for word in words]
        if not rows and header is None and len(words) > 1 and None in numbers:
            header = words
            continue
        if header is None and None in numbers:
            raise UsageError(
                f"expected numbers in line {number} of {path}, between blanks or commas, found other words: correct it"
            )
        if len(words) != len(header or rows[0] if header or rows else words):
            raise UsageError(
                f"expected {len(header or rows[0])} columns in line {number} of {path}, found {len(words)}: correct it"
            )
        rows.append([float("nan") if each is None else each for each in numbers])
    if not rows:
        raise UsageError(f"expected {what}, found no row in {path}: name another file")
    return header, np.array(rows)


def _number(word: str) -> float | None:
    """Return a cell as a number, NaN for an empty one; None for words, as tables with a header may have them."""
    try:
        return float(word.strip() or "nan")
    except ValueError:
        return None
