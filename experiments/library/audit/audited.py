"""One trajectory held against the truth, a reference or relations."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.evaluation.consistency import anees, nees, whitened

from ...scoring.trajectories import alignment_of_paths, moved, rms
from ...scoring.without_truth.relation_noise import relation_covs, sigmas_of_relations
from ...scoring.without_truth.relations import Relations, between, nearest_rows, same_scan_s
from ...usage import UsageError
from .against import paired
from .draws import LEVELS, Score, score
from .errors import errors, motion_at_start, moved_covs, since_start, to_frame
from .stated import Frame, Stated
from .suspicions import check, definite, hints, order_hint
from .verdicts import Verdict, judge

Align = Literal["none", "start", "all"]
LAGS = (1, 10, 100)
LEAST = 10
"""Poses that an audit needs."""
DEFAULT: Frame = "additive"
KNOWN_START = np.diag([1e-8, 1e-8, 1e-10])
"""Of the pose relative to the start: the covariance of a start that is known, as `--p0 zero` has it."""
IN_WORDS = {
    "additive": "additive error of x, y and heading",
    "body": "error in the body frame, log(est^-1 true)",
    "world": "error in the world frame, log(true est^-1)",
}


@dataclass(frozen=True)
class Options:
    """How errors are taken."""

    error: Frame | None = None
    """The frame that the covariances are stated in; None takes the file's own, or the additive one."""
    align: Align = "none"
    reference_sigma: tuple[float, float] | None = None
    """Standard deviations of a reference, m and rad."""
    nearest_s: float | None = None


@dataclass(frozen=True)
class Lag:
    """Relative poses over so many steps."""

    steps: int
    error_m: float
    error_rad: float
    score: Score
    is_bound: bool
    """Whether the ANEES is at least this, since the correlation of the two poses is unknown."""


@dataclass(frozen=True)
class Audited:
    """The errors of n poses or relations with their covariances, and what they say."""

    name: str
    frame: Frame
    time_s: Float[np.ndarray, " n"]
    errors: Float[np.ndarray, "n 3"]
    covs: Float[np.ndarray, "n 3 3"]
    pose: Score
    position: Score
    heading: Score
    from_start: float | None
    """ANEES relative to the start."""
    lags: tuple[Lag, ...]
    notes: tuple[str, ...]
    hints: tuple[str, ...]
    what: str = "poses"
    is_bound: bool = False
    """Whether the covariances are the largest that relations between the poses may have."""

    @property
    def nees(self) -> Float[np.ndarray, " n"]:
        """The NEES of each."""
        return nees(self.errors, self.covs)

    @property
    def verdict(self) -> Verdict:
        """The verdict on the whole pose."""
        return judge(self.pose.anees, self.pose.low, self.pose.high, self.pose.dof, self.is_bound)

    def record(self) -> dict[str, Any]:
        """Return all figures, by name."""
        verdict = self.verdict
        sigmas = np.sqrt(np.mean(np.einsum("nii->ni", self.covs), axis=0))
        return {
            "file": self.name, "verdict": verdict.words, "factor": verdict.factor,
            "factor_interval": verdict.factor_interval, "error": self.frame, "is_lower_bound": self.is_bound,
            **_figures(self.pose), "position": _figures(self.position), "heading": _figures(self.heading),
            "anees_from_start": self.from_start,
            "rms_position_m": rms(np.hypot(*self.errors[:, :2].T)), "rms_heading_rad": rms(self.errors[:, 2]),
            "stated_position_m": float(np.hypot(*sigmas[:2])), "stated_heading_rad": float(sigmas[2]),
            "lags": [
                {"steps": lag.steps, "rms_position_m": lag.error_m, "rms_heading_rad": lag.error_rad,
                 "is_lower_bound": lag.is_bound, **_figures(lag.score)} for lag in self.lags
            ],
            "notes": list(self.notes), "hints": list(self.hints),
        }  # fmt: skip


def _figures(of: Score) -> dict[str, Any]:
    coverage = {f"{level:g}": share for level, share in zip(LEVELS, of.covered, strict=True)}
    return {
        "count": of.count, "anees": of.anees, "anees_interval": [of.low, of.high], "effective_samples": of.draws,
        "median": of.median, "coverage": coverage,
    }  # fmt: skip


def audited(stated: Stated, truth: Stated, options: Options) -> Audited:
    """Return a trajectory's errors against the truth, or a reference; raises UsageError where nothing can be said."""
    frame = stated.frame or options.error or DEFAULT
    checked, at = check(stated), paired(stated, truth, options.nearest_s)
    rows = np.flatnonzero(checked.usable & at.known)
    covs = stated.planar
    assert covs is not None
    if len(rows) < LEAST:
        raise UsageError(
            f"expected at least {LEAST} poses of {stated.name} with a covariance and a time in {truth.name}, found"
            f" {len(rows)}: give more of the drive"
        )
    poses, true, covs = stated.poses_world[rows], at.poses_world[rows], covs[rows]
    align: Align = options.align if stated.held is None else "start"
    if align != "none":
        start = int(np.argmax(at.known)) if stated.held is None else stated.held
        if not at.known[start]:
            raise UsageError(
                f"expected the truth of the pose that {stated.name} is told from, its {start + 1}th, found none in"
                f" {truth.name}: add it"
            )
        both = (stated.poses_world[at.known], at.poses_world[at.known])
        start = int(np.count_nonzero(at.known[:start]))
        motion = alignment_of_paths(*both) if align == "all" else motion_at_start(*(path[start:] for path in both))
        poses, covs = moved(poses, motion), moved_covs(covs, motion, frame)
    if options.reference_sigma is not None:
        covs = covs + _of_reference(poses, options.reference_sigma, frame)
    left = errors(poses, true, frame)
    plain = stated.planar if frame == DEFAULT and align == "none" else None
    order = (
        "" if plain is None else order_hint(stated, _spread(errors(stated.poses_world, at.poses_world, frame), rows))
    )
    return Audited(
        stated.name, frame, stated.time_s[rows], left, covs, *_scores(left, covs),
        stated.anees_from_start or _from_start(poses, true, covs, frame), _lags(stated, rows, poses, true, covs, frame),
        tuple(filter(None, (*stated.notes, at.note, *checked.notes, _aligned(align)))),
        (order,) if order else tuple(hints(left, covs)),
    )  # fmt: skip


def audited_relations(stated: Stated, relations: Relations, options: Options) -> Audited:
    """Return a trajectory's relations between poses against measured ones; raises UsageError where nothing can be said.

    Without the joint covariance of two poses the largest possible one is taken, 2 (P_a + P_b), of whatever correlation.
    """
    frame, checked, covs = stated.frame or options.error or DEFAULT, check(stated), stated.planar
    assert covs is not None
    within_s = same_scan_s(stated.time_s)
    (first, near), (second, also) = (
        nearest_rows(stated.time_s, asked, within_s) for asked in (relations.first_s, relations.second_s)
    )
    # The first pose of a graph is the frame of the others, and its covariance is zero.
    usable = checked.usable | (stated.pair_covs is not None)
    chosen = np.flatnonzero(near & also & (first != second) & usable[first] & usable[second])
    if len(chosen) < LEAST:
        raise UsageError(
            f"expected at least {LEAST} relations between poses of {stated.name} within {1e3 * within_s:.3g} ms, found"
            f" {len(chosen)} of {len(relations.motions)}: use those of this drive, on the same clock"
        )
    chosen = chosen[np.argsort(relations.first_s[chosen], kind="stable")]
    taken, poses = relations.take(chosen), stated.poses_world
    stated_covs, is_bound = _between_covs(stated, first[chosen], second[chosen], frame)
    own = sigmas_of_relations(relations)
    total = stated_covs if own is None else stated_covs + own.cov
    left = between(taken.motions, between(poses[first[chosen]], poses[second[chosen]]))
    notes = ["the relations count as exact, since no three of them close a triangle"] if own is None else [
        f"sigma of a relation, from triangles of them: {own.translation_m:.3g} m and {own.rotation_rad:.3g} rad"
    ]  # fmt: skip
    if is_bound:
        notes.append("the correlation of two poses is not stated, so relations between them have the largest possible"
                     " covariance, and only overconfidence can be told")  # fmt: skip
    return Audited(
        stated.name, frame, taken.first_s, left, total, *_scores(left, total), None, (),
        (*stated.notes, *checked.notes, *notes), (), "relations", is_bound,
    )  # fmt: skip


def _scores(left: Float[np.ndarray, "n 3"], covs: Float[np.ndarray, "n 3 3"]) -> tuple[Score, Score, Score]:
    if not np.all(rest := definite(covs)):
        raise UsageError(
            f"expected covariances that are positive definite beside those of the errors' frame, found"
            f" {np.count_nonzero(~rest)} that are not: give more digits, or move the origin nearer"
        )
    parts = (slice(0, 3), slice(0, 2), slice(2, 3))
    pose, position, heading = (score(whitened(left[:, at], covs[:, at, at])) for at in parts)
    return pose, position, heading


def _of_reference(
    poses: Float[np.ndarray, "n 3"], sigmas: tuple[float, float], frame: Frame
) -> Float[np.ndarray, "n 3 3"]:
    """Return the covariance of a reference's error in the frame of the errors."""
    own = np.diag(np.square([sigmas[0], sigmas[0], sigmas[1]]))
    return to_frame(poses, np.broadcast_to(own, (len(poses), 3, 3)), "additive", frame)


def _spread(values: Float[np.ndarray, "n 3"], rows: Int[np.ndarray, " k"]) -> Float[np.ndarray, "n 3"]:
    """Return values at some rows, NaN at the others."""
    found = np.full_like(values, np.nan)
    found[rows] = values[rows]
    return found


def _aligned(align: Align) -> str:
    return {
        "none": "", "start": "the first pose was brought to the true one",
        "all": "the whole path was brought nearest to the true one, which takes part of the errors away",
    }[align]  # fmt: skip


def _from_start(
    poses: Float[np.ndarray, "n 3"], true: Float[np.ndarray, "n 3"], covs: Float[np.ndarray, "n 3 3"], frame: Frame
) -> float | None:
    """Return the ANEES of the poses relative to the first one; None where the covariance falls below that of it."""
    left, stated = since_start(poses, true, covs, frame)
    stated = 0.5 * (stated + stated.swapaxes(1, 2)) + KNOWN_START
    if not np.all(definite(stated)):
        return None
    return anees(nees(left, stated), left.shape[1])


def _lags(
    stated: Stated,
    rows: Int[np.ndarray, " n"],
    poses: Float[np.ndarray, "n 3"],
    true: Float[np.ndarray, "n 3"],
    covs: Float[np.ndarray, "n 3 3"],
    frame: Frame,
) -> tuple[Lag, ...]:
    found = []
    for steps in LAGS:
        if len(rows) <= max(steps, LEAST):
            break
        left = between(between(true[:-steps], true[steps:]), between(poses[:-steps], poses[steps:]))
        total, is_bound = _between_covs(stated, rows[:-steps], rows[steps:], frame)
        if not np.all(definite(total)):
            continue
        told = score(whitened(left, total))
        found.append(Lag(steps, rms(np.hypot(*left[:, :2].T)), rms(left[:, 2]), told, is_bound))
    return tuple(found)


def _between_covs(
    stated: Stated, first: Int[np.ndarray, " m"], second: Int[np.ndarray, " m"], frame: Frame
) -> tuple[Float[np.ndarray, "m 3 3"], bool]:
    """Return the covariances of relations between poses in the frame of the second, and whether they are bounds."""
    motions = between(stated.poses_world[first], stated.poses_world[second])
    if stated.pair_covs is not None:
        return relation_covs(motions, stated.pair_covs(first, second)), False
    own = stated.planar
    assert own is not None
    body = [to_frame(stated.poses_world[rows], own[rows], frame, "body") for rows in (first, second)]
    joint = np.zeros((len(first), 6, 6))
    joint[:, :3, :3], joint[:, 3:, 3:] = body
    return 2.0 * relation_covs(motions, joint), True
