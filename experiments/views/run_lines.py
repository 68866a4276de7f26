"""A run in a few lines: what happened, and how consistent the estimate is; and what the robot noticed of itself."""

from collections import Counter
from collections.abc import Sequence
from itertools import groupby
from math import degrees
from typing import Any

from chainslam.explore.outcome import Outcome
from chainslam.slam.association.ranges.errors import RangeErrors
from chainslam.slam.evaluation.consistency import CONSISTENT, NOISE_MODELS, noise_model
from chainslam.slam.extraction.curved_share import MOSTLY

from .numbers import listed, number, percent

Row = dict[str, Any]
SCATTER = (0.2, 3.0)
"""Approximate range of the ANEES of single runs of a consistent estimator."""

ENDED = (Outcome.ALL_CLOSED, Outcome.NONE_REACHABLE, Outcome.ENDS_LEFT)
"""Outcomes of runs that were not stopped: what these left could not be reached."""
MOST = 3
"""So many gaps are named; summary.json has all."""
MOST_LOCKED = 0.9
"""Share of its own path up to which a robot has locked itself in, or its map contradicts the path."""


def lines_of(summaries: Sequence[Row]) -> tuple[str, ...]:
    """Return what happened, and how consistent each back end is, from the summaries of runs of one drive."""
    happened = f"{'; '.join(_happened(summaries))}."
    moved = [summary for summary in summaries if summary.get("steps")]
    left = f"{_left(summaries[0])}." if len(summaries) == 1 and _left(summaries[0]) else ""
    return (*filter(None, (happened, left)), f"{_consistent(moved)}.") if moved else (happened,)


def _left(summary: Row) -> str:
    """Return what a run that found no more to do did not reach, and why; nothing where it reached all."""
    if summary.get("outcome") not in ENDED:
        return ""
    certificate = summary.get("certificate") or {}
    ends = Counter(end["why"] for end in certificate.get("open_ends") or ())
    told = [f"{number(sum(ends.values()))} open end{'s' * (sum(ends.values()) > 1)}: {_counted(ends)}"] if ends else []
    gaps = certificate.get("narrow_gaps") or ()
    told += [f"floor behind ({', '.join(number(x) for x in gap['position_m'])}) m: {gap['why']}" for gap in gaps[:MOST]]
    told += [f"floor behind {number(len(gaps) - MOST)} more such gaps"] if len(gaps) > MOST else []
    return f"not reached: {'; '.join(told)}" if told else ""


def _counted(reasons: Counter[str]) -> str:
    """Return reasons, each with how often it occurs if there are several."""
    if len(reasons) == 1:
        return next(iter(reasons))
    return ", ".join(f"{words} ({number(count)})" for words, count in reasons.most_common())


def _happened(summaries: Sequence[Row]) -> list[str]:
    """Return how the runs ended, grouped by equal endings."""
    found = []
    for words, group in groupby(summaries, _ended):
        names = [summary["backend"] for summary in group if summary.get("backend")]
        found.append(f"{listed(names)}: {words}" if names else words)
    return found


def _ended(summary: Row) -> str:
    if not summary.get("steps"):
        return f"{summary['status']} before the first step: {summary['reason']}"
    words = f"{summary['status']} after {number(summary['path_length_m'])} m and {number(summary['steps'])} steps"
    if summary.get("coverage") is not None and summary.get("contours_reachable") is not None:
        words += f" with {percent(summary['coverage'])} % of the reachable contour mapped"
    return f"{words} ({summary['reason']})"


def _consistent(summaries: Sequence[Row]) -> str:
    anees = [(summary["backend"], summary.get("pose_anees_from_start")) for summary in summaries]
    if any(value is None for _, value in anees):
        return "; ".join(map(_errs, summaries))
    errors = _errs(summaries[0]) if len(anees) == 1 else f"Pose ANEES: {listed([f'{n} {number(v)}' for n, v in anees])}"
    return errors + " (1 is ideal; single runs of a consistent estimator lie between {:g} and {:g})".format(*SCATTER)


def _errs(summary: Row) -> str:
    """Return the error of an estimate and its ANEES; without ground truth, what map and scans indicate."""
    if summary.get("pose_rmse_m") is None:
        return f"{summary['backend']}: {_untrue(summary)}"
    words = f"{summary['backend']}: pose error {number(100.0 * summary['pose_rmse_m'])} cm rms"
    if summary.get("pose_anees_from_start") is None:
        is_told = summary["lines"] is not None or summary.get("errorless")
        return words if is_told else f"{words}, no covariance stated"
    words += f", pose ANEES {number(summary['pose_anees_from_start'])}"
    return words if summary["lines"] is None else f"{words}, map ANEES {number(summary['map_anees'])}"


def _untrue(summary: Row) -> str:
    """Return the walls, and the errors of measured relations where there are any; of the smoothed path if there is one.

    Without them the NIS is all that tells of consistency, and what it says of the noise model is told where it is off.
    """
    looked = summary.get("second_looks") or summary
    words = f"{number(looked['lines'])} walls, {number(looked['duplicate_lines'])} of them duplicates"
    words = "no map" if looked["lines"] is None else words
    tail = "_smoothed" if summary.get("relations_smoothed") else ""
    relations = (summary.get(f"relations{tail}") or {}).get("at_scans", {}).get("all", {})
    if relations.get("translation_m"):
        metres, turn = (relations[kind]["median"] for kind in ("translation_m", "rotation_rad"))
        words += f"; median error of {number(relations['count'])} relations {number(metres)} m and"
        words += f" {number(degrees(turn))} degrees"
    stated = (summary.get(f"relations{tail}_normalised") or {}).get("all", {}).get("anees")
    if stated is not None:
        return f"{words}, ANEES {number(stated)} (1 is ideal)"
    nis, share = summary.get("nis"), summary.get("nis_in_band")
    if nis is None:
        return words
    model = CONSISTENT if share is None else noise_model(nis, share)
    meaning = "" if model == CONSISTENT else f"; {NOISE_MODELS[model]}"
    return f"{words}, NIS {number(nis)} (1 is ideal{meaning})"


def notes_of(summary: Row) -> list[str]:
    """Return the faults of the robot and its sensors that it noticed; empty if there are none."""
    counts = {
        "unstated_motions": "motions that the odometry did not report",
        "lost_steps": "steps without a place in the map",
        "own_beams": "returns from the robot's own body, left out",
    }
    notes = [words_on_session(summary["session"])] if summary.get("session") else []
    notes += [f"{number(summary[key])} {words}" for key, words in counts.items() if summary.get(key)]
    notes += [f"the scanner's ranges have {words}" for words in words_on_ranges(range_errors_of(summary))]
    if (summary.get("curved_share") or 0.0) > MOSTLY:
        notes.append(
            f"few straight walls: {percent(summary['curved_share'])} % of the first returns are on curved ones"
        )
    if (factor := summary.get("wheel_noise_factor") or 1.0) != 1.0:
        notes.append(f"the noise of the wheels is {number(factor)} times as large as stated")
    way_back = (summary.get("certificate") or {}).get("reachable_way")
    if way_back is not None and way_back <= MOST_LOCKED:
        notes.append(f"the robot can drive only {percent(way_back)} % of its path again")
    return notes


def words_on_session(said: Row) -> str:
    """Return where a later session found itself in the map of an earlier one, or why it has a map of its own."""
    places = listed([f"({x:.2f}, {y:.2f}) m, {degrees(turn):.0f} degrees" for x, y, turn in said["places_world"]])
    if said["first_step"] and (covs := said.get("place_covs")):
        x, y, turn = (covs[0][k][k] ** 0.5 for k in range(3))
        sure = f"{number(x)} and {number(y)} m, {number(degrees(turn))} degrees"
        return (
            f"the log begins at {places} in the map of {said['map']} (sigma {sure}; {said['place_walls'][0]} walls are"
            " in both); both sessions are one map"
        )
    if said["first_step"]:
        after = number(said["placed_at_step"] - said["first_step"] + 1)
        return f"the robot's place in the map of {said['map']} was found after {after} scans; both sessions are one map"
    why = {0: "nothing fits", 1: f"it may be {places}, but only one search says so"}.get(
        len(said["places_world"]), f"two places are possible: {places}"
    )
    return f"the robot's place in the map of {said['map']} was not found ({why}): this session has a map of its own"


def words_on_ranges(errors: RangeErrors) -> list[str]:
    """Return the significant errors of a scanner's ranges; empty if there are none."""
    found = []
    if errors.is_biased():
        found.append(f"a bias of {1e3 * errors.bias_m:+.1f} mm (sigma {1e3 * errors.bias_sigma_m:.1f} mm)")
    if errors.is_scaled():
        grown, sigma = 100.0 * (errors.scale - 1.0), 100.0 * errors.scale_sigma
        found.append(f"a scale of {grown:+.2f} % against the wheels (sigma {sigma:.2f} %)")
    return found


def range_errors_of(summary: Row) -> RangeErrors:
    """Return the estimated errors of the scanner's ranges in a summary, or unknown ones if it has none."""
    keys = {"bias_m": "range_bias_m", "bias_sigma_m": "range_bias_sigma_m"}
    keys |= {"scale": "range_scale", "scale_sigma": "range_scale_sigma"}
    said = {name: value for name, key in keys.items() if (value := summary.get(key)) is not None}
    return RangeErrors(**said)
