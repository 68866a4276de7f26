"""A replay held against what others measured of its drive."""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from slam.estimation.backend import PathKeeper

from ..artifacts.trajectories import path_of, smoothed_path
from ..scoring.records import Log
from ..scoring.without_truth.normalised import FAULTS, normalised_path, normalised_relations, pair_covs_of
from ..scoring.without_truth.references import References, scored_by
from ..scoring.without_truth.smoothing import rows_of_steps
from ..trial import TrialResult


def held_against(result: TrialResult, references: References) -> TrialResult:
    """Return a result whose summary has the scores by relations and by a reference path, as far as there are any.

    `relations` and `reference` are of the path available at each step, `*_smoothed` of the smoothed one. `*_normalised`
    are errors in units of what is stated: of the path available at each step against the reference, and of relations
    by the joint covariance of two poses, where a back end keeps all poses or second looks were taken.
    """
    log, smoothed = result.log, result.smoothed
    if log is None or (references.relations is None and references.path is None):
        return result
    scores = scored_by(references, *path_of(result, log, log.estimated_world))
    if smoothed is not None:
        of_all = scored_by(references, *smoothed_path(result, log, smoothed))
        scores |= {f"{name}_smoothed": value for name, value in of_all.items()}
    return replace(result, summary=result.summary | scores | _normalised(result, log, references))


def _normalised(result: TrialResult, log: Log, references: References) -> dict[str, Any]:
    scores: dict[str, Any] = {}
    time_s = _time_of_steps(result, log)
    path = normalised_path(references, time_s, log.estimated_world, log.estimated_cov)
    if path is not None:
        scores["reference_normalised"] = path
    backend = result.scenario.backend
    if references.relations is not None and isinstance(backend, PathKeeper):
        scanner = result.scenario.config.robot.scanner
        try:
            poses, pair_covs = pair_covs_of(backend, scanner, rows_of_steps(log.unstated_motion))
            scores["relations_normalised"] = normalised_relations(references.relations, time_s, poses, pair_covs)
        except FAULTS:
            scores["relations_normalised"] = None
    smoothed = result.smoothed
    if references.relations is not None and smoothed is not None and smoothed.pair_covs is not None:
        told = normalised_relations(references.relations, time_s, smoothed.poses_world, smoothed.pair_covs)
        scores["relations_smoothed_normalised"] = told
    return scores


def _time_of_steps(result: TrialResult, log: Log) -> Float[np.ndarray, " s"]:
    """Return when each step's scan was taken, on the clock of what others measured."""
    recorded = result.recorded
    if recorded is None:
        return log.time_s
    return recorded.scan_time_s[np.searchsorted(recorded.keyframe_of_scan, np.arange(len(log)))]
