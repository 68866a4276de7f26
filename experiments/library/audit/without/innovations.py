"""Innovations of a run of ours: each scan against its prediction by the map and the odometry before it."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.estimation.gates import mean_inside

from ....artifacts.files import CONFIG
from ....artifacts.reading import read_plain, told
from ....artifacts.saved import read_summary
from ....usage import UsageError
from ..draws import lasting
from ..reading.stated import table
from .inner import Inner, Told

LEAST = 10
"""Scans that an audit needs."""
TOLD = Told(
    "observation and motion model",
    "scans",
    "NIS per degree of freedom",
    "whether scans scatter about their prediction as the stated noise of scanner and wheels says",
    "whether the pose or the map is right: an error that both share leaves no innovation, so the pose itself cannot be"
    " judged; and what lies beyond the gate is never matched, which hides a part of too small a noise",
)


def innovations(folder: Path) -> Inner:
    """Return the innovations of a run in its folder; raises UsageError if it has none."""
    header, rows = table(folder / "steps.csv")
    names = [] if header is None else header
    if missing := [name for name in ("time_s", "nis", "nis_dof") if name not in names]:
        raise UsageError(
            f"expected columns time_s, nis and nis_dof in {folder / 'steps.csv'}, found no {missing[0]}: repeat the run"
        )
    time_s, squared, dof = (rows[:, names.index(name)] for name in ("time_s", "nis", "nis_dof"))
    used = np.flatnonzero(np.isfinite(squared) & (dof > 0))
    if len(used) < LEAST:
        raise UsageError(
            f"expected at least {LEAST} scans with innovations in {folder}, found {len(used)}: replay with a --backend"
        )
    squared, whole = squared[used], dof[used].astype(np.int64)
    left = len(rows) - len(used)
    notes = (f"{left} of {len(rows)} scans localised the robot by no match",) if left else ()
    return Inner(
        folder.resolve().name, TOLD, time_s[used], squared, whole, (), effective_dof(squared, whole), notes,
        mean_inside(_gate(folder / CONFIG), 2), str(read_summary(folder)["backend"]),
    )  # fmt: skip


def _gate(path: Path) -> float:
    """Return the probability of the gate that a run had, whatever version wrote its settings; raises UsageError."""
    with told(path, "keep a run's files together, or repeat the run"):
        found: Any = read_plain(path)
    for key in ("trial", "mission", "mapper", "matching", "gate"):
        found = found.get(key) if isinstance(found, dict) else None
    if not isinstance(found, float) or not 0.0 < found < 1.0:
        raise UsageError(f"expected the gate of the matching in {path}, found {str(found)[:40]}: repeat the run")
    return found


def effective_dof(squared: Float[np.ndarray, " n"], dof: Int[np.ndarray, " n"]) -> float:
    """Return the degrees of freedom of the sum of a series of squared normalised values.

    Independent ones of a chi-square have those of all together. They have fewer where the values are correlated, by
    the sum of their autocorrelation to the first lag at which it is not positive, and where they scatter more than a
    chi-square scaled to their mean.
    """
    scale = float(squared.sum()) / float(dof.sum())
    if not scale > 0.0:
        return float(dof.sum())
    off = (squared / scale - dof) / np.sqrt(2.0 * dof)
    wider = max(float(np.average(off**2, weights=dof)), 1.0)
    return max(float(dof.sum()) / (wider * lasting(off, 1)), float(np.max(dof)))
