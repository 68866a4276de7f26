"""Comparison of a replay with measurements of its drive."""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.slam.estimation.backend import PathKeeper

from ..artifacts.trajectories import estimated_path, smoothed_path
from ..scoring.records import Log
from ..scoring.without_truth.normalised import FAULTS, normalised_path, normalised_relations, pair_covs_of
from ..scoring.without_truth.references import References, scored_by
from ..scoring.without_truth.relations import SAME_TIME_S, interpolated, paired_poses, same_scan_s
from ..scoring.without_truth.smoothing import rows_of_steps
from ..trial import TrialResult
from ..usage import UsageError

CLOCKS = {"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3}
UNITS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37}
OTHER_UNIT = 20.0
"""Odometry is never wrong by such a factor, however much the wheels slip."""
MOVED_M = 0.5
"""Shorter paths say nothing about the unit."""


def check_references(
    references: References, time_s: Float[np.ndarray, " s"], wheels_world: Float[np.ndarray, "s 3"]
) -> None:
    """Raise UsageError if measurements cannot belong to this drive: no common time, or another unit.

    `wheels_world` are the poses of the odometry at the times of the log.
    """
    if references.path is not None:
        times, poses = references.path
        ours, theirs = paired_poses(time_s, wheels_world, times, poses)
        if not len(ours):
            raise UsageError(_no_common_time("reference", time_s, times))
        _check_unit("reference", np.hypot(*(theirs - theirs[0])[:, :2].T), np.hypot(*(ours - ours[0])[:, :2].T))
    if (given := references.relations) is not None:
        known = given.within(float(time_s[0]) - SAME_TIME_S, float(time_s[-1]) + SAME_TIME_S)
        if not len(known.motions):
            raise UsageError(_no_common_time("relations", time_s, np.concatenate([given.first_s, given.second_s])))
        first, second = (interpolated(time_s, wheels_world, asked) for asked in (known.first_s, known.second_s))
        _check_unit("relations", np.hypot(*known.motions[:, :2].T), np.hypot(*(second - first)[:, :2].T))


def _no_common_time(what: str, ours: Float[np.ndarray, " s"], theirs: Float[np.ndarray, " r"]) -> str:
    low, high, least, most = (float(value) for value in (ours[0], ours[-1], theirs.min(), theirs.max()))
    unit = next((unit for unit, s in CLOCKS.items() if s * most >= low and s * least <= high), None)
    if unit is not None:
        hint = f"its times are in {unit}: divide them"
    elif most - least <= 2.0 * (high - low) and abs(least) < 1.0 < abs(low):
        hint = f"its times count from its beginning: add about {low:.3f} s"
    elif most >= low and least <= high:
        hint = "use one that was measured at the scans, or interpolate it to their times"
    else:
        hint = "use one of this drive, on the same clock"
    return (
        f"expected a time of the {what} within {1e3 * SAME_TIME_S:.0f} ms of a scan, found none: the log is of"
        f" {low:.3f} to {high:.3f} s, the {what} of {least:.3f} to {most:.3f} s; {hint}"
    )


def _check_unit(what: str, theirs_m: Float[np.ndarray, " k"], ours_m: Float[np.ndarray, " k"]) -> None:
    """Raise UsageError if distances differ by a factor that only another unit explains."""
    theirs, ours = float(theirs_m.sum()), float(ours_m.sum())
    if max(theirs_m.max(initial=0.0), ours_m.max(initial=0.0)) < MOVED_M or min(theirs, ours) <= 0.0:
        return
    factor = theirs / ours
    if factor > OTHER_UNIT:
        unit = min(UNITS, key=lambda name: abs(np.log(factor / UNITS[name])))
        raise UsageError(
            f"expected a {what} in metres, found it {factor:.0f} times as long as the odometry: {unit}? divide it"
        )
    if factor < 1.0 / OTHER_UNIT:
        raise UsageError(
            f"expected a {what} in metres, found it {1.0 / factor:.0f} times shorter than the odometry: multiply it, or"
            " use one of this drive"
        )


def held_against(result: TrialResult, references: References) -> TrialResult:
    """Return a result whose summary has the scores by relations and by a reference path, as far as they exist.

    `relations` and `reference` are computed from the path available at each step, `*_smoothed` from the smoothed one.
    `*_normalised` are normalised errors: of the path available at each step against the reference, and of relations
    with the joint covariance of two poses, if the back end keeps all poses or the log was refined offline.
    """
    log, smoothed = result.log, result.smoothed
    if log is None or (references.relations is None and references.path is None):
        return result
    scores = scored_by(references, *estimated_path(result, log))
    if smoothed is not None:
        of_all = scored_by(references, *smoothed_path(result, log, smoothed))
        scores |= {f"{name}_smoothed": value for name, value in of_all.items()}
    return replace(result, summary=result.summary | scores | _normalised(result, log, references))


def _normalised(result: TrialResult, log: Log, references: References) -> dict[str, Any]:
    scores: dict[str, Any] = {}
    time_s, recorded = _time_of_steps(result, log), result.recorded
    within_s = same_scan_s(time_s if recorded is None else recorded.scan_time_s)
    path = normalised_path(references, time_s, log.estimated_world, log.estimated_cov, within_s)
    if path is not None:
        scores["reference_normalised"] = path
    backend = result.scenario.backend
    if references.relations is not None and isinstance(backend, PathKeeper):
        scanner = result.scenario.config.robot.scanner
        try:
            poses, pair_covs = pair_covs_of(backend, scanner, rows_of_steps(log.unstated_motion))
            scores["relations_normalised"] = normalised_relations(
                references.relations, time_s, poses, pair_covs, within_s
            )
        except FAULTS:
            scores["relations_normalised"] = None
    smoothed = result.smoothed
    if references.relations is not None and smoothed is not None and smoothed.pair_covs is not None:
        told = normalised_relations(references.relations, time_s, smoothed.poses_world, smoothed.pair_covs, within_s)
        scores["relations_smoothed_normalised"] = told
    return scores


def _time_of_steps(result: TrialResult, log: Log) -> Float[np.ndarray, " s"]:
    """Return the time of each step's scan, on the clock of the measurements."""
    recorded = result.recorded
    if recorded is None:
        return log.time_s
    return recorded.scan_time_s[np.searchsorted(recorded.keyframe_of_scan, np.arange(len(log)))]
