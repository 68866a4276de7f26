"""`audit` as a function: trajectories of any SLAM system, and what can be said of their covariances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from ...scoring.without_truth.references import read_relations
from ...usage import UsageError
from .audited import Align, Audited, Options, audited, held_against
from .stated import Frame, Stated, read_folder, read_text
from .verdicts import Pair, Pooled, compare, pool
from .words import lines, pooled_line

Paths = str | Path | Sequence[str | Path]
GIVE = "give --truth FILE, --reference FILE or --relations FILE"


@dataclass(frozen=True)
class Audit:
    """An audit of one or several trajectories."""

    trajectories: tuple[Audited, ...]
    pooled: Pooled | None
    """Over several runs of one estimator, each with a truth of its own."""
    pairs: tuple[Pair, ...]
    """Of several estimators on one drive."""
    error: Frame | None
    """The frame that was asked for."""

    @property
    def verdict(self) -> list[str]:
        """The findings, in words."""
        told = [line for found in self.trajectories for line in lines(found, self.error is not None)]
        if self.pooled is not None:
            told.append(pooled_line(self.pooled))
        return [*told, *(pair.told() for pair in self.pairs)]

    def record(self) -> dict[str, Any]:
        """Return all figures, by name."""
        pooled = self.pooled
        return {
            "trajectories": [each.record() for each in self.trajectories],
            "pooled": pooled and {
                "runs": pooled.runs, "verdict": pooled.verdict.words, "factor": pooled.verdict.factor,
                "factor_interval": pooled.verdict.factor_interval, "anees": pooled.anees,
                "anees_interval": [pooled.low, pooled.high],
            },
            "pairs": [
                {"first": pair.first, "second": pair.second, "nees_ratio": pair.ratio,
                 "nees_ratio_interval": pair.interval, "stretches": pair.blocks} for pair in self.pairs
            ],
        }  # fmt: skip

    def __repr__(self) -> str:
        return "\n".join(self.verdict)


def audit(
    trajectories: Paths,
    *,
    truth: Paths = (),
    reference: Paths = (),
    relations: str | Path | None = None,
    error: Frame | None = None,
    align: Align = "none",
    reference_sigma: tuple[float, float] | None = None,
    nearest: float | None = None,
) -> Audit:
    """Tell whether the covariances of trajectories may be believed, as `chainslam audit` does.

    `trajectories` are files or folders of runs. `truth`, or a `reference` with standard deviations `reference_sigma`
    (m, rad), is one file for each, which are then runs of one estimator, or one for all, which are then different
    estimators. `relations` is a file of measured relations between poses. `error` is the frame that the covariances are
    stated in, "additive", "body" or "world". `nearest` takes the nearest true pose within so many seconds, which is
    otherwise interpolated. Raises UsageError for bad input.
    """
    paths, true, references = _paths(trajectories), _paths(truth), _paths(reference)
    _check(paths, true, references, relations, reference_sigma)
    options = Options(error, align, reference_sigma, nearest)
    stated = _named([read(path) for path in paths])
    if relations is not None:
        measured = read_relations(Path(relations))
        found = tuple(held_against(each, measured, options) for each in stated)
        return Audit(found, None, _pairs(found, stated[:1] * len(found)), error)
    known = true or references or _own(stated)
    if len(known) not in (1, len(paths)):
        raise UsageError(f"expected one truth for all or one for each of {len(paths)} trajectories, found {len(known)}")
    truths = [read(path) for path in known]
    every = truths if len(truths) == len(stated) else truths * len(stated)
    found = tuple(audited(each, against, options) for each, against in zip(stated, every, strict=True))
    estimators = {each.estimator for each in stated} - {None}
    runs_of_one = len(stated) > 1 and len(truths) == len(stated) and (len(estimators) < 2 or bool(true or references))
    return Audit(found, pool([each.pose for each in found]) if runs_of_one else None,
                 () if runs_of_one else _pairs(found, every), error)  # fmt: skip


def read(path: Path) -> Stated:
    """Read a trajectory of whatever format; raises UsageError."""
    return read_folder(path) if path.is_dir() else read_text(path)


def _paths(given: Paths) -> list[Path]:
    return [Path(given)] if isinstance(given, str | Path) else [Path(each) for each in given]


def _check(
    paths: list[Path], truth: list[Path], reference: list[Path], relations: Any, sigma: tuple[float, float] | None
) -> None:
    if not paths:
        raise UsageError("expected a trajectory with covariances, found none: name a file or the folder of a run first")
    given = [name for name, each in (("truth", truth), ("reference", reference), ("relations", relations)) if each]
    if len(given) > 1:
        raise UsageError(
            f"expected one of --truth, --reference and --relations, found {' and '.join(given)}: choose one"
        )
    if sigma is not None and (not reference or min(sigma) < 0.0 or not np.all(np.isfinite(sigma))):
        found = f"{sigma[0]:g} {sigma[1]:g}" if reference else "none"
        raise UsageError(
            f"expected --reference-sigma as metres and radians beside --reference, found {found}: correct it"
        )


def _own(stated: Sequence[Stated]) -> list[Path]:
    """Return the truths in the folders of runs; raises UsageError if one has none."""
    for each in stated:
        if each.truth is None:
            raise UsageError(f"expected something to compare {each.name} with, found none: {GIVE}")
    return [each.truth for each in stated if each.truth is not None]


def _named(stated: list[Stated]) -> list[Stated]:
    """Return trajectories of different names."""
    from dataclasses import replace

    names = [each.name for each in stated]
    return [
        replace(each, name=f"{each.name} ({k + 1})") if names.count(each.name) > 1 else each
        for k, each in enumerate(stated)
    ]


def _pairs(found: Sequence[Audited], truths: Sequence[Stated]) -> tuple[Pair, ...]:
    """Return the comparison of every two estimates of one drive at the times that both have."""
    pairs = []
    for (one, true), (other, also) in combinations(zip(found, truths, strict=True), 2):
        _, a, b = np.intersect1d(np.round(one.time_s, 3), np.round(other.time_s, 3), return_indices=True)
        if len(a) and np.array_equal(true.poses_world, also.poses_world):
            draws = min(one.pose.draws, other.pose.draws) * len(a) / max(len(one.time_s), len(other.time_s))
            pairs.append(compare((one.name, other.name), one.nees[a], other.nees[b], draws))
    return tuple(pairs)
