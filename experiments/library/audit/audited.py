"""One trajectory held against the truth, a reference or relations."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.evaluation.consistency import anees, nees, whitened

from ...scoring.trajectories import rms
from ...scoring.without_truth.relations import Relations, nearest_rows, same_scan_s
from ...usage import UsageError
from .against import paired
from .draws import LEVELS, Cross, Score, joint_dof, score
from .geometry.kinds import geometry_of, misclosures, parts, since_start
from .geometry.plane import Frame
from .reading.relative import relative
from .reading.stated import Stated
from .suspicions import check, definite, hints, order_hint
from .verdicts import Verdict, judge

Align = Literal["none", "start", "all"]
LAGS = (1, 10, 100)
LEAST = 10
"""Poses that an audit needs."""
EXACT = 1e-9
"""Errors below it, m and rad, in all poses are those of a copy."""
DEFAULT: Frame = "additive"
KNOWN_START = (1e-8, 1e-10)
"""Of position and rotation relative to the start: the variances of a start that is known, as `--p0 zero` has it."""
ADDITIVE = {3: "additive error of x, y and heading", 6: "additive error of x y z and the turns about these axes"}
IN_WORDS = {
    "body": "error in the body frame, log(est^-1 true)",
    "world": "error in the world frame, log(true est^-1)",
}


@dataclass(frozen=True)
class Options:
    """How errors are taken."""

    error: Frame | None = None
    """The frame that the covariances are stated in, or that those of a graph are converted into; None takes its own."""
    align: Align = "none"
    reference_sigma: tuple[float, float] | None = None  # of a reference, m and rad
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
    errors: Float[np.ndarray, "n d"]
    """Along d axes: 3 in the plane, 6 in space."""
    covs: Float[np.ndarray, "n d d"]
    pose: Score
    position: Score
    heading: Score
    """In space: of the whole rotation."""
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
    def error_in_words(self) -> str:
        """The definition of the error."""
        return IN_WORDS.get(self.frame) or ADDITIVE[self.errors.shape[1]]

    @property
    def turn(self) -> str:
        """What the rotation is called: the heading in the plane."""
        return "heading" if self.errors.shape[1] == 3 else "rotation"

    @property
    def verdict(self) -> Verdict:
        """The verdict on the whole pose."""
        return judge(self.pose.anees, self.pose.low, self.pose.high, self.pose.dof, self.is_bound)

    def record(self) -> dict[str, Any]:
        """Return all figures, by name."""
        verdict, turn = self.verdict, self.turn
        position, rotation = parts(self.errors.shape[1])
        sigmas = np.sqrt(np.mean(np.einsum("nii->ni", self.covs), axis=0))
        return {
            "file": self.name, "verdict": verdict.words, "factor": verdict.factor,
            "factor_interval": verdict.factor_interval, "error": self.frame, "is_lower_bound": self.is_bound,
            **_figures(self.pose), "position": _figures(self.position), turn: _figures(self.heading),
            "anees_from_start": self.from_start,
            "rms_position_m": _size(self.errors[:, position]), f"rms_{turn}_rad": _size(self.errors[:, rotation]),
            "stated_position_m": float(np.linalg.norm(sigmas[position])),
            f"stated_{turn}_rad": float(np.linalg.norm(sigmas[rotation])),
            "lags": [
                {"steps": lag.steps, "rms_position_m": lag.error_m, f"rms_{turn}_rad": lag.error_rad,
                 "is_lower_bound": lag.is_bound, **_figures(lag.score)} for lag in self.lags
            ],
            "notes": list(self.notes), "hints": list(self.hints),
        }  # fmt: skip


def _size(errors: Float[np.ndarray, "n d"]) -> float:
    """Return the rms length of errors."""
    return rms(np.linalg.norm(errors, axis=1))


def _figures(of: Score) -> dict[str, Any]:
    coverage = {f"{level:g}": share for level, share in zip(LEVELS, of.covered, strict=True)}
    return {
        "count": of.count, "anees": of.anees, "anees_interval": [of.low, of.high], "effective_samples": of.draws,
        "median": of.median, "coverage": coverage,
    }  # fmt: skip


def audited(stated: Stated, truth: Stated, options: Options) -> Audited:
    """Return a trajectory's errors against the truth, or a reference; raises UsageError where nothing can be said."""
    frame = options.error or stated.frame or DEFAULT
    checked, at = check(stated), paired(stated, truth, options.nearest_s)
    rows = np.flatnonzero(checked.usable & at.known)
    covs, by = stated.used_covs, geometry_of(stated.poses_world)
    assert covs is not None
    if len(rows) < LEAST:
        raise UsageError(
            f"expected at least {LEAST} poses of {stated.name} with a covariance and a time in {truth.name}, found"
            f" {len(rows)}: give more of the drive"
        )
    poses, true = stated.poses_world[rows], at.poses_world[rows]
    covs = by.to_frame(poses, covs[rows], stated.frame or frame, frame)
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
        motion = (
            by.alignment_of_paths(*both) if align == "all" else by.motion_at_start(*(path[start:] for path in both))
        )
        poses, covs = by.moved(poses, motion), by.moved_covs(covs, motion, frame)
    if options.reference_sigma is not None:
        covs = covs + _of_reference(poses, options.reference_sigma, frame, covs.shape[1])
    if not np.any(np.abs(left := by.errors(poses, true, frame)) > EXACT):
        raise UsageError(f"expected {truth.name} to differ from {stated.name}, found the same poses: name the truth")
    plain = stated.used_covs if frame == DEFAULT and align == "none" else None
    scores = _scores(left, covs, by.to_frame(poses, covs, frame, "body"), stated.cross_at(rows))
    order = "" if plain is None else order_hint(stated, _spread(left, rows, len(stated.time_s)))
    return Audited(
        stated.name, frame, stated.time_s[rows], left, covs, *scores,
        stated.anees_from_start or _from_start(poses, true, covs, frame), _lags(stated, rows, poses, true, frame),
        tuple(filter(None, (*stated.notes, at.note, *checked.notes, _aligned(align)))),
        (order,) if order else tuple(hints(left, covs)),
    )  # fmt: skip


def audited_relations(stated: Stated, relations: Relations, options: Options) -> Audited:
    """Return a trajectory's relations between poses against measured ones; raises UsageError where nothing can be said.

    Without the joint covariance of two poses the largest possible one is taken, 2 (P_a + P_b), of whatever correlation.
    """
    frame, checked = stated.frame or options.error or DEFAULT, check(stated)
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
    between = relative(stated, first[chosen], second[chosen], frame)
    by, own = geometry_of(poses), misclosures(relations).sigmas
    total = between.covs if own is None else between.covs + own.cov_of(between.covs.shape[1])
    left = by.coordinates(by.between(taken.motions, by.between(poses[first[chosen]], poses[second[chosen]])))
    notes = ["the relations count as exact, since no three of them close a triangle"] if own is None else [
        f"sigma of a relation, from triangles of them: {own.translation_m:.3g} m and {own.rotation_rad:.3g} rad,"
        f" within which {own.mistaken} of {own.mistaken + own.told_by} do not close (99 % region)"
    ]  # fmt: skip
    if between.is_bound:
        notes.append("the correlation of two poses is not stated, so relations between them have the largest possible"
                     " covariance, and only overconfidence can be told")  # fmt: skip
    return Audited(
        stated.name, frame, taken.first_s, left, total, *_scores(left, total, total, between.cross), None, (),
        (*stated.notes, *checked.notes, *notes), (), "relations", between.is_bound,
    )  # fmt: skip


def _dof(covs: Float[np.ndarray, "n d d"], cross: Cross | None, part: slice = slice(None)) -> float | None:
    """Return the degrees of freedom of the mean NEES along some axes of the body, if it is known how errors depend."""
    if cross is None:
        return None
    whiten = np.linalg.inv(np.linalg.cholesky(covs[:, part, part]))
    return joint_dof(whiten, lambda some: cross(some)[:, part, :, part])


def _scores(
    left: Float[np.ndarray, "n d"],
    covs: Float[np.ndarray, "n d d"],
    body: Float[np.ndarray, "n d d"],
    cross: Cross | None,
) -> tuple[Score, Score, Score]:
    """Return the scores of pose, position and rotation; `body` and `cross` are covariances in the body frames."""
    if not np.all(rest := definite(covs)):
        raise UsageError(
            f"expected covariances that are positive definite beside those of the errors' frame, found"
            f" {np.count_nonzero(~rest)} that are not: give more digits, or move the origin nearer"
        )
    pose, position, heading = (
        score(whitened(left[:, at], covs[:, at, at]), _dof(body, cross, at))
        for at in (slice(None), *parts(left.shape[1]))
    )
    return pose, position, heading


def _of_reference(
    poses: Float[np.ndarray, "n p"], sigmas: tuple[float, float], frame: Frame, axes: int
) -> Float[np.ndarray, "n d d"]:
    """Return the covariance of a reference's error in the frame of the errors."""
    own = np.diag(np.square(np.repeat(sigmas, [len(range(axes)[part]) for part in parts(axes)])))
    return geometry_of(poses).to_frame(poses, np.tile(own, (len(poses), 1, 1)), "additive", frame)


def _spread(values: Float[np.ndarray, "k d"], rows: Int[np.ndarray, " k"], count: int) -> Float[np.ndarray, "n d"]:
    """Return values in some of so many rows, NaN in the others."""
    found = np.full((count, values.shape[1]), np.nan)
    found[rows] = values
    return found


def _aligned(align: Align) -> str:
    return {
        "none": "", "start": "the first pose was brought to the true one",
        "all": "the whole path was brought nearest to the true one, which takes part of the errors away",
    }[align]  # fmt: skip


def _from_start(
    poses: Float[np.ndarray, "n p"], true: Float[np.ndarray, "n p"], covs: Float[np.ndarray, "n d d"], frame: Frame
) -> float | None:
    """Return the ANEES of the poses relative to the first one; None where the covariance falls below that of it."""
    axes = covs.shape[1]
    left, stated = since_start(poses, true, covs, frame)
    stated = 0.5 * (stated + stated.swapaxes(1, 2)) + np.diag(
        np.repeat(KNOWN_START, [len(range(axes)[part]) for part in parts(axes)])
    )
    if not np.all(definite(stated)):
        return None
    return anees(nees(left, stated), left.shape[1])


def _lags(
    stated: Stated,
    rows: Int[np.ndarray, " n"],
    poses: Float[np.ndarray, "n p"],
    true: Float[np.ndarray, "n p"],
    frame: Frame,
) -> tuple[Lag, ...]:
    by, found = geometry_of(poses), []
    for steps in LAGS:
        if len(rows) <= max(steps, LEAST):
            break
        left = by.coordinates(by.between(*(by.between(path[:-steps], path[steps:]) for path in (true, poses))))
        position, rotation = parts(left.shape[1])
        between = relative(stated, rows[:-steps], rows[steps:], frame)
        if not np.all(definite(between.covs)):
            continue
        told = score(whitened(left, between.covs), _dof(between.covs, between.cross))
        found.append(Lag(steps, _size(left[:, position]), _size(left[:, rotation]), told, between.is_bound))
    return tuple(found)
