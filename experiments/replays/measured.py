"""A replay held against what others measured of its drive."""

from dataclasses import replace

from ..artifacts.results import path_of
from ..scoring.without_truth.references import References, scored_by
from ..trial import TrialResult


def held_against(result: TrialResult, references: References) -> TrialResult:
    """Return a result whose summary has the scores by relations and by a reference path, as far as there are any.

    `relations` and `reference` are of the path available at each step, `*_smoothed` of the smoothed one.
    """
    log, smoothed = result.log, result.smoothed
    if log is None or (references.relations is None and references.path is None):
        return result
    scores = scored_by(references, *path_of(result, log, log.estimated_world))
    if smoothed is not None:
        of_all = scored_by(references, *path_of(result, log, smoothed.poses_world))
        scores |= {f"{name}_smoothed": value for name, value in of_all.items()}
    return replace(result, summary=result.summary | scores)
