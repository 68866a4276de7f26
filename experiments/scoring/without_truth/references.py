"""Measurements of a recorded drive: relations between its poses, or a reference path, and scores by them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from chainslam.sim.logs.archive import regular
from chainslam.sim.logs.recorded_robot import MOST_M
from chainslam.slam.geometry.poses import wrap

from ...usage import UsageError
from ..trajectories import ate
from .relations import (
    Relations,
    errors_at_scans,
    errors_between_scans,
    paired_poses,
)

MOST_BYTES = 2**28
BYTE_ORDER_MARK = "\xef\xbb\xbf"
"""What spreadsheets write before a table, as Latin-1 has it."""
RELATION, TUM, PLANAR = 8, 8, 4
"""Numbers on a line of a relations file, of a path in the TUM format, and of a path as `t x y theta`."""
LEAST = 3
"""Poses that an alignment needs."""


@dataclass(frozen=True)
class References:
    """The measurements that a path is scored by; None for those that do not exist."""

    relations: Relations | None = None
    path: tuple[Float[np.ndarray, " r"], Float[np.ndarray, "r 3"]] | None = None
    """Times and poses."""


def read_references(relations: Path | None, path: Path | None) -> References:
    """Read the files of either kind; raises UsageError, in one line, for anything else."""
    return References(
        None if relations is None else read_relations(relations), None if path is None else read_path(path)
    )


def read_relations(path: Path, in_space: bool = False) -> Relations:
    """Read lines `t1 t2 x y z roll pitch yaw` as the Freiburg benchmark has them; raises UsageError.

    In space the rotation is the roll about x, then the pitch about y and the yaw about z, about fixed axes as in ROS.
    """
    rows = _table(path, (RELATION,), "relations (t1 t2 x y z roll pitch yaw)")
    if (most := np.abs(rows[:, 5:]).max()) > 2.0 * np.pi:
        raise UsageError(f"expected roll, pitch and yaw in radians in {path.name}, found {most:.4g}: degrees?")
    if in_space:
        motions = np.column_stack([rows[:, 2:5], Rotation.from_euler("xyz", rows[:, 5:8]).as_quat()])
    else:
        motions = np.column_stack([rows[:, 2:4], wrap(rows[:, 7])])
    return Relations(rows[:, 0], rows[:, 1], motions)


def read_path(path: Path) -> tuple[Float[np.ndarray, " r"], Float[np.ndarray, "r 3"]]:
    """Read a path in the TUM format or as `t x y theta`, in the order of its times; raises UsageError."""
    rows = _table(path, (TUM, PLANAR), "a path (t x y z qx qy qz qw, or t x y theta)")
    headings = rows[:, 3] if rows.shape[1] == PLANAR else 2.0 * np.arctan2(rows[:, 6], rows[:, 7])
    order = np.argsort(rows[:, 0], kind="stable")
    return rows[order, 0], np.column_stack([rows[:, 1:3], wrap(headings)])[order]


def lines_of(path: Path, what: str) -> list[str]:
    """Return the lines of a text file in which `what` is expected; raises UsageError if it cannot be read."""
    try:
        if regular(path).stat().st_size > MOST_BYTES:
            raise UsageError(f"expected {what}, found {path.name} of more than {MOST_BYTES >> 20} MiB: name another")
        return path.read_text(encoding="latin-1").removeprefix(BYTE_ORDER_MARK).splitlines()
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise UsageError(f"expected {what}, found {path.name} ({reason}): name a file that exists") from error


def _table(path: Path, widths: tuple[int, ...], what: str) -> Float[np.ndarray, "n w"]:
    """Return the numbers of a text file, the same count on each line; lines that begin with # are comments."""
    rows: list[list[float]] = []
    for number, line in enumerate(lines_of(path, what), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        times = 1 + (widths == (RELATION,))
        rows.append(_numbers(words, times, f"expected {what}, found in line {number} of {path.name}"))
        if len(words) not in widths or len(words) != len(rows[0]):
            raise UsageError(f"expected {what}, found {len(words)} numbers in line {number} of {path.name}: correct it")
    if not rows:
        raise UsageError(f"expected {what}, found none in {path.name}: name another file")
    return np.array(rows)


def _numbers(words: list[str], times: int, expected: str) -> list[float]:
    """Return the numbers of a line, of which the first ones are times; raises UsageError."""
    try:
        numbers = [float(word) for word in words]
    except ValueError as error:
        raise UsageError(f"{expected} other words: correct it") from error
    if not np.all(np.isfinite(numbers)) or np.abs(numbers[times:]).max(initial=0.0) > MOST_M * MOST_M:
        raise UsageError(f"{expected} numbers that are none: correct it")
    return numbers


def scored_by(
    references: References, time_s: Float[np.ndarray, " s"], poses_world: Float[np.ndarray, "s 3"]
) -> dict[str, Any]:
    """Return the scores of a path by the measurements; without a key for those that do not exist."""
    scores: dict[str, Any] = {}
    if references.relations is not None and len(time_s):
        scores["relations"] = {
            "at_scans": _of_errors(*errors_at_scans(time_s, poses_world, references.relations)),
            "interpolated": _of_errors(*errors_between_scans(time_s, poses_world, references.relations)),
        }
    if references.path is not None and len(time_s):
        estimated, reference = paired_poses(time_s, poses_world, *references.path)
        enough = len(estimated) >= LEAST
        scores["reference"] = {
            "poses": len(estimated),
            "ate_m": ate(estimated, reference) if enough else None,
            "ate_aligned_m": ate(estimated, reference, align=True) if enough else None,
        }
    return scores


def _of_errors(relations: Relations, errors: Float[np.ndarray, "k 2"]) -> dict[str, Any]:
    return {"all": _spread(errors), "far": _spread(errors[relations.far])}


def _spread(errors: Float[np.ndarray, "k 2"]) -> dict[str, Any]:
    """Return mean, median, standard deviation and maximum of the errors; null where there are none."""
    if not len(errors):
        return {"count": 0, "translation_m": None, "rotation_rad": None}
    parts = {
        name: {
            "mean": float(column.mean()),
            "median": float(np.median(column)),
            "sd": float(column.std()),
            "max": float(column.max()),
        }
        for name, column in zip(("translation_m", "rotation_rad"), errors.T, strict=True)
    }
    return {"count": len(errors), **parts}
