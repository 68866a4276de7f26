"""The report of a campaign: its tables and comparison as a page of words, tables and pictures."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from viz.report import Page, PageTable, Section

from ..scenario import UsageError
from .merge import union
from .pictures import curve_pictures, map_pictures, ratio_pictures
from .plan import CLOSED, Campaign
from .store import read_campaigns, read_config
from .words import command_of, interval, number, verdict

ARM_WORDS = {
    CLOSED: "closed loop: each back end drives",
    "replay-own": "replay, own gate: one recording, each matches for itself",
    "replay-true": "replay, true association: the algebra alone",
}


def page_of(folder: Path) -> Page:
    """Return the report of a campaign's folder; raises UsageError where it is none, or not done."""
    campaigns, config = read_campaigns(folder), read_config(folder)
    campaign = union(campaigns)
    try:
        said: dict[str, Any] = json.loads((folder / "comparison.json").read_text())
    except (OSError, ValueError) as error:
        raise UsageError(
            f"expected a campaign that is done, found {folder} without its comparison.json: run `compare` to its end"
        ) from error
    made = config if "versions" in config else config["from"][0]
    return Page(
        "What neglecting the cross-correlations costs",
        verdict(said["hypothesis"]),
        "; ".join(command_of(each) for each in campaigns),
        (*made["versions"].items(), ("commit", str(made["commit"])[:10])),
        (
            _counts(said),
            *_estimators(campaign, said),
            Section("Consistency along the way", _BAND_WORDS, pictures=curve_pictures(folder, campaign)),
            Section("Maps", ("One seed, closed loop, by every back end.",), pictures=map_pictures(folder, campaigns)),
            Section("Against the full EKF", _RATIO_WORDS, _differences(said["backends"]), ratio_pictures(said)),
            Section("Strategies", _STRATEGY_WORDS, (_strategies(said), _interaction(said))),
            Section("At equal metres driven", _MARK_WORDS, (_marks(said),)),
        ),
    )


_BAND_WORDS = (
    "ANEES over the trials at each step: inside the band an estimator knows how wrong it is, above it, it is"
    " overconfident.",
)
_RATIO_WORDS = (
    "Paired by run: the same world, start and noise. A ratio above 1 is worse than the full EKF; the interval is that"
    " of a bootstrap of whole runs.",
)
_STRATEGY_WORDS = (
    "Paired by run, against nearest-robot. The interaction tells how much more a back end gains by a strategy than"
    " the full EKF does: 1 is no interaction.",
)
_MARK_WORDS = ("Closed loop. A run drives on, has finished before (its last state counts) or has failed.",)


def _counts(said: dict[str, Any]) -> Section:
    counts = said["counts"]
    words = (
        f"{counts['trials']} trials: {counts['complete']} complete, {counts['stopped']} stopped by a limit,"
        f" {counts['failed']} failed. A trial that is not complete is in no mean and is counted beside it."
    )
    return Section("Trials", (words,))


def _estimators(campaign: Campaign, said: dict[str, Any]) -> list[Section]:
    tables = []
    for arm in campaign.arms:
        rows = [_estimator_row(row) for row in said["pooled"] if row["arm"] == arm]
        tables.append(PageTable(ARM_WORDS[arm], _ESTIMATOR_HEADER, tuple(rows)))
    return [Section("Estimators, over all worlds and strategies", _ESTIMATOR_WORDS, tuple(tables))]


_ESTIMATOR_HEADER = (
    *("back end", "complete", "pose ANEES (95 % interval)", "median", "map ANEES", "walls, cm", "path, cm"),
    *("double", "false", "missed %", "distances held % (95 % interval)", "least trace", "bound margin"),
)
_ESTIMATOR_WORDS = (
    "ANEES: 1 is ideal. Walls and path: rms error. Double: walls entered twice. False, missed: matches held against the"
    " truth. Distances held: share of intervals of corner distances that hold the truth. Least trace: of the pose's"
    " covariance, over the initial one. Bound margin: negative where an estimator claims to know where the world is.",
)


def _estimator_row(row: dict[str, Any]) -> tuple[str, ...]:
    pose, held = row["pose_anees"], row["distances_in_95"]
    return (
        row["backend"],
        f"{row['complete']} of {row['trials']}",
        *((f"{number(pose['mean'])} ({interval(pose)})", number(pose["median"])) if pose else ("–", "–")),
        number(row["map_anees"] and row["map_anees"]["mean"]),
        number(row["wall_rmse_m"] and 100 * row["wall_rmse_m"]["mean"]),
        number(row["ate_m"] and 100 * row["ate_m"]["mean"]),
        number(row["duplicate_lines"]),
        number(row["matches_false"]),
        number(None if row["missed_share"] is None else 100 * row["missed_share"]),
        f"{number(100 * held['mean'])} ({interval(held, 100.0)})" if held else "–",
        number(row["trace_least"]),
        number(row["bound_margin"], 2),
    )


def _differences(rows: Sequence[dict[str, Any]]) -> tuple[PageTable, ...]:
    kept = [row for row in rows if row["measure"] in ("pose_anees", "wall_rmse_m", "ate_m", "duplicate_lines")]
    header = ("back end", "arm", "measure", "kind", "value", "95 % interval", "effect size", "runs", "better in %")
    return (
        PageTable(
            "Back ends against full-ekf",
            header,
            tuple((row["first"], row["arm"], row["measure"], row["kind"], *_told(row)) for row in kept),
            "Effect size: mean paired difference over its standard deviation. Better: share of runs; a failure loses.",
        ),
    )


def _told(row: dict[str, Any]) -> tuple[str, ...]:
    better = row.get("first_better")
    words = (number(row["value"]), interval(row), number(row.get("effect_size"), 2), number(row["runs"]))
    return (*words, number(None if better is None else 100 * better))


def _strategies(said: dict[str, Any]) -> PageTable:
    kept = [
        row
        for row in said["strategies"]
        if row["arm"] == CLOSED and row["measure"] in ("pose_anees", "wall_rmse_m", "path_length_m")
    ]
    header = ("strategy", "back end", "measure", "ratio", "95 % interval", "effect size", "runs", "better in %")
    rows = tuple((row["first"], row["backend"], row["measure"], *_told(row)) for row in kept)
    return PageTable("Strategies against nearest-robot, closed loop", header, rows)


def _interaction(said: dict[str, Any]) -> PageTable:
    kept = [
        row
        for row in said["interaction"]
        if row["arm"] == CLOSED and row["measure"] in ("pose_anees", "wall_rmse_m", "path_length_m")
    ]
    header = ("strategy", "back end", "measure", "ratio of ratios", "95 % interval", "effect size", "runs")
    rows = tuple((row["strategy"], row["backend"], row["measure"], *_told(row)[:-1]) for row in kept)
    return PageTable("Interaction of strategy and back end, closed loop", header, rows)


def _marks(said: dict[str, Any]) -> PageTable:
    header = (
        *("world", "strategy", "back end", "metres", "driving", "finished", "failed", "pose, cm", "walls, cm"),
        *("pose ANEES so far", "coverage %"),
    )
    rows = tuple(
        (
            *(row[key] for key in ("world", "strategy", "backend", "metres")),
            *(number(row[key]) for key in ("driving", "finished", "failed")),
            *(number(None if row[key] is None else 100 * row[key]) for key in ("pose_error_m", "wall_rmse_m")),
            number(row["pose_anees_so_far"]),
            number(None if row["coverage"] is None else 100 * row["coverage"]),
        )
        for row in said["marks"]
        if row["arm"] == CLOSED
    )
    return PageTable("Means over the runs that drive on or have finished", header, rows)
