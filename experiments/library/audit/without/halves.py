"""Two trajectories of one drive, of which each was estimated from another half of the data, against each other."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....scoring.without_truth.relations import nearest_rows
from ....usage import UsageError
from ..against import paired
from ..audited import DEFAULT, LEAST, Audited, Options, audited
from ..reading.stated import Stated
from ..suspicions import check

NOTE = (
    "the covariance of the difference is the sum of both: data, priors and faults that both share leave it smaller, so"
    " only overconfidence can be told, and an error that both share cannot be seen"
)


def halves_of(stated: Sequence[Stated], options: Options) -> Audited:
    """Return the difference of two trajectories at the times of the first; raises UsageError where nothing can be said.

    The second one is interpolated, as a truth is. Their errors count as independent. Shared data correlates them, which
    makes the difference smaller than stated.
    """
    if len(stated) != 2:
        raise UsageError(f"expected two trajectories for --halves, found {len(stated)}: name both")
    one, other = stated
    frame = one.frame or options.error or DEFAULT
    ours, theirs = one.used_covs, other.used_covs
    usable, also = check(one).usable, check(other).usable
    if ours is None or theirs is None or frame != (other.frame or options.error or DEFAULT):
        raise UsageError(f"expected two trajectories of one kind, found {one.name} and {other.name}: give the same")
    at = paired(one, other, options.nearest_s)
    asked = one.time_s if options.nearest_s is None else other.time_s[nearest_rows(other.time_s, one.time_s)[0]]
    cells = (np.interp(asked, other.time_s, cell) for cell in theirs.reshape(len(theirs), -1).T)
    total = ours + np.stack(list(cells), axis=1).reshape(ours.shape)
    chosen = np.flatnonzero(usable & at.known & (np.interp(asked, other.time_s, also) == 1.0))
    if len(chosen) < LEAST:
        raise UsageError(
            f"expected at least {LEAST} poses of {one.name} and {other.name} with covariances at common times, found"
            f" {len(chosen)}: give more of the drive"
        )
    both = replace(
        one, name=f"{one.name} against {other.name}", time_s=one.time_s[chosen], poses_world=one.poses_world[chosen],
        covs=total[chosen], held=None, pair_covs=None, cross_covs=None, anees_from_start=None, spatial=None,
    )  # fmt: skip
    against = replace(other, time_s=one.time_s[chosen], poses_world=at.poses_world[chosen], covs=None, spatial=None)
    found = audited(both, against, replace(options, nearest_s=None))
    lags = tuple(replace(lag, is_bound=True) for lag in found.lags)
    notes = tuple(note for note in (at.note, *found.notes) if note)
    return replace(found, is_bound=True, from_start=None, lags=lags, notes=(NOTE, *notes))
