"""Innovation statistics, which need no truth: what a robot can monitor while it drives."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from chainslam.slam.estimation.gates import gate_level
from chainslam.slam.evaluation.consistency import chi2_band

from .records import Log

WINDOW = 20
"""Scans whose innovations are taken together."""


def windowed_nis(log: Log) -> Float[np.ndarray, " s"]:
    """Return the NIS of the last `WINDOW` scans over its degrees of freedom; 1 is ideal, 0 where none was matched."""
    squared, dof = (_last(values) for values in (log.nis, log.nis_dof))
    return np.asarray(squared / np.maximum(dof, 1.0))


def nis_in_band(log: Log) -> Bool[np.ndarray, " s"]:
    """Return whether the NIS of the last `WINDOW` scans is inside the two-sided 95 % band of its chi-square."""
    squared, dof = (_last(values) for values in (log.nis, log.nis_dof))
    bands = {n: (gate_level(0.025, n), gate_level(0.975, n)) for n in np.unique(dof[dof > 0]).astype(int).tolist()}
    inside = [n > 0 and bands[int(n)][0] <= value <= bands[int(n)][1] for value, n in zip(squared, dof, strict=True)]
    return np.array(inside, dtype=bool)


def share_in_own_band(values: Sequence[float], dofs: Sequence[int]) -> float:
    """Return the share of scans whose NIS lies in the two-sided 95 % band of its own chi-square."""
    bands = {dof: chi2_band(dof) for dof in set(dofs)}
    inside = [bands[dof][0] <= value <= bands[dof][1] for value, dof in zip(values, dofs, strict=True)]
    return float(np.mean(inside))


def innovation_scores(log: Log) -> dict[str, Any]:
    """Return the innovation statistics for `summary.json`."""
    total = int(log.nis_dof.sum())
    return {
        "nis": float(log.nis.sum()) / total if total else None,
        "nis_in_band": float(np.mean(nis_in_band(log)[log.nis_dof > 0])) if total else None,
        "unstated_motions": int(np.count_nonzero(log.unstated_motion)),
        "lost_steps": int(np.count_nonzero(log.is_lost)),
        "wheel_noise_factor": float(log.wheel_noise_factor[-1]),
    }


def _last(values: Float[np.ndarray, " s"] | np.ndarray) -> Float[np.ndarray, " s"]:
    """Return the sum of each value and those before it, `WINDOW` in all."""
    sums = np.concatenate([np.zeros(1), np.cumsum(values, dtype=np.float64)])
    ends = np.arange(1, len(values) + 1)
    return np.asarray(sums[ends] - sums[np.maximum(ends - WINDOW, 0)])
