"""comparison.json: the comparison of a campaign's tables, with each difference paired by run and with its interval."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np

from ...scoring.statistics import estimate, paired, share_better
from ..plan import CLOSED, Campaign
from .consistency import consistency
from .families import in_family

Row = dict[str, Any]
Runs = dict[tuple[str, int], float]


@dataclass(frozen=True)
class Measure:
    """A column that is compared; smaller is better."""

    name: str
    is_ratio: bool
    """Whether logarithms are compared, so that a difference is a ratio."""
    floor: float = 0.0
    """Added before the logarithm is taken."""

    @property
    def ended(self) -> tuple[str, ...]:
        """Required end of a run: the path of a run that a limit ended is not the length of an exploration."""
        return ("complete",) if self.name == "path_length_m" else SOUND


MEASURES = (
    Measure("pose_anees_from_start", True),
    Measure("pose_anees", True),
    Measure("map_anees", True),
    Measure("ate_m", True),
    Measure("wall_rmse_m", True),
    Measure("wall_shape_m", True),
    Measure("heading_rmse_rad", True),
    Measure("path_length_m", True),
    Measure("duplicate_lines", False),
    Measure("false_matches", False),
    Measure("matches_missed", False),
    Measure("double_entries", False),
)
MEANS = (
    "pose_anees_from_start",
    *("pose_anees", "map_anees", "joint_anees", "ate_m", "wall_rmse_m", "wall_shape_m", "heading_rmse_rad"),
    *("nis", "nis_in_band", "nis_mean", "nis_whiteness", "path_length_m"),
)
MAY_LACK = (
    *("pose_anees_from_start", "pose_anees", "map_anees", "joint_anees", "wall_rmse_m", "wall_shape_m"),
    "pose_anees_so_far",
)
"""Columns that a run may lack: one covariance that is not positive definite has no NEES, a map without a wall no error.
Means leave such runs out, and `without` beside them says how many."""
AT_MARKS = (
    *("pose_error_m", "wall_rmse_m", "wall_shape_m", "pose_anees_so_far", "map_anees", "coverage"),
    "duplicate_lines",
)
SOUND = ("complete", "stopped")
"""Ends of runs with scores: complete, or at a limit."""
SUMS = (
    *("duplicate_lines", "false_matches", "matches_true", "matches_missed", "matches_false"),
    *("merges", "false_merges", "sightings", "double_entries", "distances"),
)
"""Columns that are summed over runs."""
BASELINE_BACKEND, BASELINE_STRATEGY = "full-ekf", "nearest-robot"


def compare(campaign: Campaign, trials: Sequence[Row], marks: Sequence[Row], bands: Sequence[Row]) -> dict[str, Any]:
    """Return the comparison of a campaign's tables; differences are first less second, ratios first over second.

    `bands` has a row for each cell, in the order of the trials, with what its steps say.
    """
    cells = [cell | band for cell, band in zip(_cells(trials), bands, strict=True)]
    return {
        "counts": _counts(trials),
        "pooled": _pooled(campaign, trials, cells),
        "cells": cells,
        "backends": in_family(_backends(campaign, trials)),
        "strategies": in_family(_strategies(campaign, trials)),
        "interaction": in_family(_interaction(campaign, trials)),
        "marks": _marks(marks),
    }


def arm_of(row: Row) -> str:
    """Return the arm of a row: its mode, and for a replay its association."""
    return CLOSED if row["mode"] == CLOSED else f"replay-{row['association']}"


def runs_of(rows: Iterable[Row], measure: Measure) -> Runs:
    """Return the measure of each run, averaged over everything else; without runs that failed or have no value."""
    found: dict[tuple[str, int], list[float]] = {}
    for row in rows:
        value = row.get(measure.name)
        if value is None or row["status"] not in measure.ended or not math.isfinite(value):
            continue
        if measure.is_ratio:
            if value + measure.floor <= 0:
                continue
            value = math.log(value + measure.floor)
        found.setdefault((row["world"], row["seed"]), []).append(float(value))
    return {run: float(np.mean(values)) for run, values in found.items()}


def difference(first: Sequence[Row], second: Sequence[Row], measure: Measure) -> dict[str, Any]:
    """Return the paired comparison of two sets of rows by one measure."""
    a, b = runs_of(first, measure), runs_of(second, measure)
    runs = {(row["world"], row["seed"]) for row in (*first, *second)}
    return {
        "measure": measure.name,
        "kind": "ratio" if measure.is_ratio else "difference",
        **_told(paired(a, b), measure),
        "pairs_without_value": len(runs) - len(a.keys() & b.keys()),
        "first_better": share_better(a, b, runs),
    }


def _told(differences: Runs, measure: Measure) -> dict[str, Any]:
    found = estimate(differences)
    if found is None:
        return {"value": None, "low": None, "high": None, "runs": 0}
    of: Callable[[float], float] = math.exp if measure.is_ratio else float
    ends = {name: getattr(found, name) for name in ("low", "high", "low_buildings", "high_buildings")}
    return {
        "value": of(found.mean),
        **{name: None if end is None else of(end) for name, end in ends.items()},
        "effect_size": found.effect_size,
        "p": found.p,
        "runs": found.runs,
    }


def select(rows: Iterable[Row], **wanted: Any) -> list[Row]:
    """Return the rows that have the wanted values; `arm` may be one of them."""
    arm = wanted.pop("arm", None)
    return [
        row
        for row in rows
        if (arm is None or arm_of(row) == arm) and all(row[key] == value for key, value in wanted.items())
    ]


def _counts(rows: Sequence[Row]) -> dict[str, int]:
    states = [row["status"] for row in rows]
    return {"trials": len(rows), **{state: states.count(state) for state in ("complete", "stopped", "failed")}}


def _pooled(campaign: Campaign, rows: Sequence[Row], cells: Sequence[Row]) -> list[Row]:
    """Return a row for each back end in each arm, over all worlds and strategies; the unit is the run."""
    found = []
    for arm, backend in _runs_in(campaign):
        outside = [c["steps_outside_band"] for c in cells if (c["arm"], c["backend"]) == (arm, backend)]
        mine = select(rows, backend=backend, arm=arm)
        lost = next((row.get("reason") for row in mine if row["status"] == "failed"), None)
        names = {"backend": backend, "arm": arm, "lost": lost}
        found.append({**names, **cell_scores(mine), "steps_outside_band": _mean(outside)})
    return found


def _runs_in(campaign: Campaign) -> list[tuple[str, str]]:
    """Return every arm with each back end that runs in it."""
    every = product(campaign.arms, campaign.backends)
    return [(arm, backend) for arm, backend in every if arm in campaign.arms_of(backend)]


def _cells(rows: Sequence[Row]) -> list[Row]:
    """Return a row for each cell: means with intervals over runs, and how many did not complete."""
    cells: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        cells.setdefault((row["world"], row["strategy"], row["backend"], arm_of(row)), []).append(row)
    return [
        dict(zip(("world", "strategy", "backend", "arm"), cell, strict=True)) | cell_scores(mine)
        for cell, mine in cells.items()
    ]


def cell_scores(rows: Sequence[Row]) -> Row:
    """Return the scores of some trials together.

    Means, sums and extremes are over the runs that completed or ended at a limit; those that failed are counted.
    """
    complete = [row for row in rows if row["status"] == "complete"]
    sound = [row for row in rows if row["status"] in SOUND]
    scores: Row = {"trials": len(rows), "complete": len(complete), "sound": len(sound)}
    for name in MEANS:
        runs = runs_of(rows, Measure(name, False))
        found = estimate(runs)
        scores[name] = None if found is None else asdict(found) | {"median": float(np.median(list(runs.values())))}
    scores["without"] = without(sound, MEANS)
    for name in SUMS:
        told = [value for row in sound if (value := row.get(name)) is not None]
        scores[name] = sum(told) if told or not sound else None
    for name in ("distances_in_95", "trace_below", "missed_share", "doubles_beyond_gate"):
        found = estimate(runs_of(rows, Measure(name, False)))
        scores[name] = None if found is None else asdict(found)
    for name in ("trace_least", "bound_margin"):
        values = [row[name] for row in sound if row.get(name) is not None]
        scores[name] = min(values) if values else None
    below = [row for row in sound if row.get("bound_first_m") is not None]
    scores["bound_runs_below"] = len(below)
    for name in ("bound_margin", "bound_first_m", "bound_worst_m"):
        scores[f"{name}_median"] = float(np.median([row[name] for row in below])) if below else None
    scores["pose_nees_in_band"] = _mean([row.get("pose_nees_in_band") for row in sound])
    return scores | consistency(scores)


def without(rows: Sequence[Row], names: Sequence[str]) -> dict[str, int]:
    """Return the number of rows without a value, by column; only those of `names` that a run may lack."""
    return {name: sum(not _is_told(row.get(name)) for row in rows) for name in names if name in MAY_LACK}


def _is_told(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def _mean(values: Iterable[float | int | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _backends(campaign: Campaign, rows: Sequence[Row]) -> Iterable[Row]:
    """Compare every back end with the baseline, in each arm, over all strategies."""
    if BASELINE_BACKEND not in campaign.backends:
        return
    for arm, backend in _runs_in(campaign):
        if backend != BASELINE_BACKEND:
            first, second = (select(rows, arm=arm, backend=name) for name in (backend, BASELINE_BACKEND))
            names = {"arm": arm, "first": backend, "second": BASELINE_BACKEND}
            yield from (names | difference(first, second, measure) for measure in MEASURES)


def _strategies(campaign: Campaign, rows: Sequence[Row]) -> Iterable[Row]:
    """Compare every strategy with the baseline, for each back end in each arm."""
    if BASELINE_STRATEGY not in campaign.strategies:
        return
    for (arm, backend), strategy in product(_runs_in(campaign), campaign.strategies):
        if strategy != BASELINE_STRATEGY:
            mine = select(rows, arm=arm, backend=backend)
            first, second = (select(mine, strategy=name) for name in (strategy, BASELINE_STRATEGY))
            names = {"arm": arm, "backend": backend, "first": strategy, "second": BASELINE_STRATEGY}
            yield from (names | difference(first, second, measure) for measure in MEASURES)


def _interaction(campaign: Campaign, rows: Sequence[Row]) -> Iterable[Row]:
    """Return how much more (or less) a back end gains by a strategy than the baseline back end does."""
    if BASELINE_BACKEND not in campaign.backends or BASELINE_STRATEGY not in campaign.strategies:
        return
    for (arm, backend), strategy, measure in product(_runs_in(campaign), campaign.strategies, MEASURES):
        if backend == BASELINE_BACKEND or strategy == BASELINE_STRATEGY:
            continue
        gains = []
        runs = {(row["world"], row["seed"]) for row in select(rows, arm=arm)}
        for name in (backend, BASELINE_BACKEND):
            mine = select(rows, arm=arm, backend=name)
            pair = (runs_of(select(mine, strategy=s), measure) for s in (strategy, BASELINE_STRATEGY))
            gains.append(paired(*pair))
        yield {
            "arm": arm, "backend": backend, "strategy": strategy, "measure": measure.name,
            "kind": "ratio of ratios" if measure.is_ratio else "difference of differences",
            **_told(paired(*gains), measure), "pairs_without_value": len(runs) - len(paired(*gains)),
        }  # fmt: skip


def _marks(rows: Sequence[Row]) -> list[Row]:
    """Return the runs that are driving, finished or failed at each mark, and their means, for each combination."""
    cells: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        cells.setdefault((row["world"], row["strategy"], row["backend"], arm_of(row), row["metres"]), []).append(row)
    found = []
    for cell, mine in cells.items():
        states = [row["state"] for row in mine]
        alive = [row for row in mine if row["state"] != "failed"]
        scores = {name: _mean([row.get(name) for row in alive]) for name in AT_MARKS}
        found.append(
            dict(zip(("world", "strategy", "backend", "arm", "metres"), cell, strict=True))
            | {state: states.count(state) for state in ("driving", "finished", "failed")}
            | scores
            | {"without": without(alive, AT_MARKS)}
        )
    return found
