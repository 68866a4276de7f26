"""The report of a campaign: its tables and comparison as a page of words, tables and pictures."""

from collections.abc import Sequence
from math import pi
from pathlib import Path
from typing import Any

from chainslam.slam.evaluation.consistency import verdict_on_noise
from chainslam.viz.reports.report import Page, PageTable, Section, filled

from ...artifacts.reading import read_json
from ...views.numbers import NONE, number, percent
from ..comparison.families import family_words, is_clear
from ..comparison.shapes import COMPARISON
from ..comparison.story import story_of
from ..comparison.words import ARMS_SHORT, MEASURE_WORDS, command_of, interval, mean, share, within
from ..merge import union
from ..plan import CLOSED, Campaign, is_errorless
from ..scores.score import END
from ..store import read_config
from .finding_words import finding_table
from .pictures import coverage_pictures, curve_pictures, map_arm, map_pictures, ratio_pictures

ARM_WORDS = {
    CLOSED: "each back end drives",
    "replay-own": "one recording, each back end matches for itself",
    "replay-true": "one recording, matches told by the truth: the algebra alone",
}


def page_of(folder: Path) -> Page:
    """Return the report of a campaign's folder; raises UsageError where it is none, or not done."""
    config = read_config(folder)
    campaigns = config.campaigns
    campaign = union(campaigns)
    said = read_json(folder / "comparison.json", COMPARISON, "run the same `compare` to its end")
    story = story_of(campaign, said)
    return Page(
        story.title,
        story.question,
        story.verdict,
        "; ".join(command_of(each) for each in campaigns),
        (*config.versions.items(), ("commit", str(config.commit)[:10])),
        filled(
            Section("What it shows", _counts(said), (finding_table(campaign, said),)),
            *(() if is_errorless(campaign) else _consistency(folder, campaign, said)),
            Section("Maps", _map_words(campaign), pictures=map_pictures(folder, campaigns)),
            Section(
                "Strategies",
                _STRATEGY_WORDS,
                (_strategies(said), _interaction(said)),
                coverage_pictures(folder, campaigns),
            ),
            Section("At equal metres driven", _MARK_WORDS, (marks_table(said),)),
        ),
    )


def _consistency(folder: Path, campaign: Campaign, said: dict[str, Any]) -> tuple[Section, ...]:
    """Return whether each estimator knows how wrong it is, and how far it is from the full EKF."""
    return (
        *_estimators(campaign, said),
        Section("Consistency along the way", _BAND_WORDS, pictures=curve_pictures(folder, campaign)),
        Section("Against the full EKF", _RATIO_WORDS, _differences(said["backends"]), ratio_pictures(said)),
    )


_BAND_WORDS = (
    "ANEES over the trials at each step: inside the band an estimator knows how wrong it is, above it, it is"
    " overconfident.",
)
_RATIO_WORDS = (
    "Paired by run: the same world, start and noise. A ratio above 1 is worse than the full EKF. The interval is that"
    " of a studentised bootstrap of whole runs, and that for other buildings Student's over the buildings' means; fewer"
    " than five have none.",
)
_STRATEGY_WORDS = (
    "Paired by run, against nearest-robot. The interaction tells how much more a back end gains by a strategy than"
    " the full EKF does: 1 is no interaction.",
)
_MARK_WORDS = (
    "Closed loop. A run drives on, has finished before (its last state counts) or has failed. Lengths that no run"
    " reached are left out.",
)


def _map_words(campaign: Campaign) -> tuple[str, ...]:
    return (
        f"One seed, {ARMS_SHORT[map_arm(campaign)]}, by every back end. Blue: walls in closed chains; orange: in open"
        " ones; grey: tentative, or the true walls behind; dark line: the path as the robot believes it.",
    )


def _counts(said: dict[str, Any]) -> tuple[str, ...]:
    counts = said["counts"]
    return (
        f"{counts['trials']} trials: {counts['complete']} complete, {counts['stopped']} stopped by a limit,"
        f" {counts['failed']} failed. A trial that is not complete is in no mean and is counted beside it;"
        " wrong matches, duplicate walls and the extremes are those of stopped runs, too.",
    )


def _estimators(campaign: Campaign, said: dict[str, Any]) -> list[Section]:
    honesty, innovations, errors = [], [], []
    for arm in campaign.arms:
        rows, title = [row for row in said["pooled"] if row["arm"] == arm], f"{ARMS_SHORT[arm]}: {ARM_WORDS[arm]}"
        listens = any(row["nis_mean"] is not None for row in rows)
        header = _INNOVATION_HEADER + (_NIS_HEADER if listens else ())
        told = (_innovation_row(row) + (_nis_row(row) if listens else ()) for row in rows)
        honesty.append(PageTable(title, _HONESTY_HEADER, tuple(map(_honesty_row, rows))))
        innovations.append(PageTable(title, header, tuple(told)))
        errors.append(PageTable(title, _ERROR_HEADER, tuple(map(_error_row, rows))))
    return [
        Section("Does it know how wrong it is?", _HONESTY_WORDS, tuple(honesty)),
        Section("Innovations, and what no scan can tell", _INNOVATION_WORDS, tuple(innovations)),
        Section("How wrong is it?", _ERROR_WORDS, tuple(errors)),
    ]


_HONESTY_HEADER = (
    *("back end", "complete", "pose ANEES from the start (95 % interval)", "median", "pose ANEES", "map ANEES"),
    "without: from the start, pose, map",
    *("steps outside the band %", "distances held % (95 % interval)"),
)
_INNOVATION_HEADER = ("back end", "NIS", "in its band %", "noise", "least trace", "bound margin")
_NIS_HEADER = ("NIS of true matches", "whiteness")
_HONESTY_WORDS = (
    "Over all worlds and strategies. ANEES: mean squared error over what the estimator expects; 1 is ideal, above it"
    " is overconfident. From the start: the pose relative to the start, whose own error nothing can observe and which"
    " drowns all other in the plain pose ANEES. Without: complete runs that have no such ANEES, since a covariance was"
    " not positive definite (or the map has no wall): they are in no mean of it. Distances held: share of the 95 %"
    " intervals of corner distances that hold the truth.",
)
_INNOVATION_WORDS = (
    "NIS: squared innovations of the matches over what is expected, ideally 1, and the share of scans that lie in its"
    " 95 % band with those before them; noise: what that says of the noise that is stated. A gate cuts off the tail of"
    " it. On true matches also the NIS before any gate, and its correlation from scan to scan, ideally 1 and 0. Least"
    " trace: of the pose's covariance, over the initial one. Bound margin: negative where an estimator claims to know"
    " where the world lies, which no scan tells.",
)
_ERROR_HEADER = (
    *("back end", "walls, cm", "shape, cm", "without", "path, cm", "heading, degrees", "duplicates"),
    "of these merged",
    *("false matches", "missed matches %", "observations"),
)
_ERROR_WORDS = (
    "Over all worlds and strategies, rms. Walls: after undoing the error of the start; shape: after the best shift and"
    " turn of the whole map; without: complete runs with no wall to hold against the truth. Matches are held against"
    " the truth; a gate of 99 % misses 1 % of them where the estimate is honest.",
)


def _honesty_row(row: dict[str, Any]) -> tuple[str, ...]:
    pose = row.get("pose_anees_from_start")
    return (
        row["backend"],
        f"{row['complete']} of {row['trials']}",
        *((within(number(pose["mean"]), pose), number(pose["median"])) if pose else (NONE, NONE)),
        mean(row["pose_anees"]),
        mean(row["map_anees"]),
        ", ".join(number(row["without"].get(name, 0)) for name in ("pose_anees_from_start", "pose_anees", "map_anees")),
        percent(row["steps_outside_band"]),
        share(row["distances_in_95"]),
    )


def _innovation_row(row: dict[str, Any]) -> tuple[str, ...]:
    nis, in_band = row.get("nis"), row.get("nis_in_band")
    return (
        row["backend"],
        mean(nis),
        mean(in_band, scale=100.0),
        verdict_on_noise(nis["mean"], in_band["mean"]) if nis and in_band else NONE,
        number(row["trace_least"]),
        number(row["bound_margin"], 2),
    )


def _nis_row(row: dict[str, Any]) -> tuple[str, ...]:
    return mean(row["nis_mean"]), mean(row["nis_whiteness"], 2)


def _error_row(row: dict[str, Any]) -> tuple[str, ...]:
    return (
        row["backend"],
        *(mean(row[name], scale=100.0) for name in ("wall_rmse_m", "wall_shape_m")),
        number(row["without"].get("wall_rmse_m", 0)),
        mean(row["ate_m"], scale=100.0),
        mean(row["heading_rmse_rad"], scale=180.0 / pi),
        *(number(row[name]) for name in ("double_entries", "merges", "matches_false")),
        percent(row["missed_share"] and row["missed_share"]["mean"]),
        number(row["sightings"]),
    )


def _differences(rows: Sequence[dict[str, Any]]) -> tuple[PageTable, ...]:
    kept = [
        row for row in rows if row["measure"] in ("pose_anees_from_start", "wall_rmse_m", "ate_m", "double_entries")
    ]
    header = ("back end", "arm", "measure", "kind", "value", *_TOLD_HEADER)
    return (
        PageTable(
            "Back ends against full-ekf",
            header,
            tuple(
                (row["first"], ARMS_SHORT[row["arm"]], MEASURE_WORDS[row["measure"]], row["kind"], *_told(row))
                for row in kept
            ),
            "Effect size: mean paired difference over its standard deviation. Left out: runs that did not complete with"
            f" both, or for which one has no such value. Better: share of runs; a failure loses. {family_words(rows)}",
        ),
    )


_TOLD_HEADER = ("95 % interval", "effect size", "runs", "left out", "clear", "better in %")


def _told(row: dict[str, Any]) -> tuple[str, ...]:
    better = row.get("first_better")
    counts = (number(row["runs"]), number(row["pairs_without_value"]), "yes" if is_clear(row) else "")
    words = (number(row["value"]), interval(row), number(row.get("effect_size"), 2), *counts)
    return (*words, number(None if better is None else 100 * better))


def _strategies(said: dict[str, Any]) -> PageTable:
    kept = [
        row
        for row in said["strategies"]
        if row["arm"] == CLOSED and row["measure"] in ("pose_anees_from_start", "wall_rmse_m", "path_length_m")
    ]
    header = ("strategy", "back end", "measure", "ratio", *_TOLD_HEADER)
    rows = tuple((row["first"], row["backend"], MEASURE_WORDS[row["measure"]], *_told(row)) for row in kept)
    note = family_words(said["strategies"])
    return PageTable("Strategies against nearest-robot, closed loop", header, rows, note)


def _interaction(said: dict[str, Any]) -> PageTable:
    kept = [
        row
        for row in said["interaction"]
        if row["arm"] == CLOSED and row["measure"] in ("pose_anees_from_start", "wall_rmse_m", "path_length_m")
    ]
    header = ("strategy", "back end", "measure", "ratio of ratios", *_TOLD_HEADER[:-1])
    rows = tuple((row["strategy"], row["backend"], MEASURE_WORDS[row["measure"]], *_told(row)[:-1]) for row in kept)
    note = family_words(said["interaction"])
    return PageTable("Interaction of strategy and back end, closed loop", header, rows, note)


def marks_table(said: dict[str, Any]) -> PageTable:
    """Return the means at equal metres driven, at the lengths that some run reached."""
    header = (
        *("world", "strategy", "back end", "metres", "driving", "finished", "failed", "pose, cm", "walls, cm"),
        *("pose ANEES so far", "without: walls, ANEES", "coverage %"),
    )
    reached = {END, *(row["metres"] for row in said["marks"] if row["arm"] == CLOSED and row["driving"])}
    rows = tuple(
        (
            *(row[key] for key in ("world", "strategy", "backend", "metres")),
            *(number(row[key]) for key in ("driving", "finished", "failed")),
            *(number(None if row[key] is None else 100 * row[key]) for key in ("pose_error_m", "wall_rmse_m")),
            number(row["pose_anees_so_far"]),
            ", ".join(number(row["without"].get(name, 0)) for name in ("wall_rmse_m", "pose_anees_so_far")),
            number(None if row["coverage"] is None else 100 * row["coverage"]),
        )
        for row in said["marks"]
        if row["arm"] == CLOSED and row["metres"] in reached
    )
    return PageTable("Means over the runs that drive on or have finished", header, rows)
