"""What a trajectory is compared with: the truth or a reference at the same times."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ...scoring.without_truth.relations import SAME_TIME_S, nearest_rows
from ...usage import UsageError
from .geometry.kinds import geometry_of
from .reading.stated import Stated

GAP_S = 1.0
"""Longer gaps of the truth are not interpolated."""
SAME_S = 1e-3
"""Times closer than this are one: a robot moves a millimetre meanwhile."""
CLOCKS = {"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3}


@dataclass(frozen=True)
class Paired:
    """The true poses at the times of a trajectory, NaN where they are unknown."""

    poses_world: Float[np.ndarray, "n p"]
    known: Bool[np.ndarray, " n"]
    note: str


def paired(stated: Stated, truth: Stated, nearest_s: float | None = None) -> Paired:
    """Return the truth at the times of a trajectory; raises UsageError if their clocks do not overlap.

    If most samples of the truth are at times of the trajectory, to 1 ms, only these are taken; otherwise it is
    interpolated between samples that are at most a second apart, or, where most are farther apart, the nearest within
    10 ms. `nearest_s` takes the nearest within it.
    """
    asked, known_s = stated.time_s, truth.time_s
    rows, near = nearest_rows(known_s, asked)
    off = np.abs(known_s[rows] - asked)
    inside = np.count_nonzero((known_s >= asked[0] - SAME_S) & (known_s <= asked[-1] + SAME_S))
    if nearest_s is not None:
        known, poses, words = off <= nearest_s, truth.poses_world[rows], f"nearest within {nearest_s:g} s"
    elif np.count_nonzero(off <= SAME_S) > 0.5 * inside:
        known, poses, words = off <= SAME_S, truth.poses_world[rows], ""
    else:
        after = np.clip(np.searchsorted(known_s, asked), 0, len(known_s) - 1)
        before = np.maximum(after - 1, 0)
        known = (known_s[before] <= asked) & (asked <= known_s[after]) & (known_s[after] - known_s[before] <= GAP_S)
        poses, words = geometry_of(truth.poses_world).interpolated(known_s, truth.poses_world, asked), "interpolated"
        if np.count_nonzero(near) > 2 * np.count_nonzero(known):
            return paired(stated, truth, SAME_TIME_S)
    if not np.any(known):
        raise UsageError(_no_common_time(stated, truth, nearest_s))
    left = len(asked) - int(np.count_nonzero(known))
    notes = [f"{truth.name} is {words}"] if words else []
    notes += [f"{left} of {len(asked)} poses have no time in it"] if left else []
    return Paired(poses, known, "; ".join(notes))


def _no_common_time(stated: Stated, truth: Stated, nearest_s: float | None) -> str:
    low, high, least, most = (float(each) for path in (stated, truth) for each in path.time_s[[0, -1]])
    unit = next((name for name, s in CLOCKS.items() if _agree((low, high), (s * least, s * most))), None)
    back = next((name for name, s in CLOCKS.items() if _agree((s * low, s * high), (least, most))), None)
    if most >= low and least <= high:
        near = f"within {nearest_s:g} s" if nearest_s is not None else f"between samples at most {GAP_S:g} s apart"
        return (
            f"expected times of {stated.name} {near} of {truth.name}, found none: --nearest SECONDS takes nearer ones"
        )
    if unit is not None or back is not None:
        hint = f"the times of {truth.name if unit else stated.name} are in {unit or back}: divide them"
    elif _agree((0.0, high - low), (0.0, most - least)):
        hint = f"if they count from different beginnings, shift one by about {abs(low - least):.3f} s"
    else:
        hint = "use one of the same drive, on the same clock"
    return (
        f"expected a common time, found {stated.name} of {low:.3f} to {high:.3f} s and {truth.name} of {least:.3f} to"
        f" {most:.3f} s: {hint}"
    )


def _agree(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Return whether two spans of time overlap and are about as long."""
    lengths = sorted((one[1] - one[0], other[1] - other[0]))
    return one[1] >= other[0] and one[0] <= other[1] and lengths[1] <= 10.0 * lengths[0]
