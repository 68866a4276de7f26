"""The tables of a campaign's report."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import pi
from typing import Any

from chainslam.slam.evaluation.consistency import noise_model
from chainslam.viz.reports.report import PageTable, table
from chainslam.viz.text import NONE

from ...scoring.maps.swept import PERCENTS
from ...views.numbers import BUILDINGS, digits_apart, estimated, interval, number, percent
from ..comparison.consistency import in_words
from ..comparison.families import is_clear
from ..plan import CLOSED
from ..scores.score import END

Row = dict[str, Any]
Columns = Mapping[str, Callable[[Row], str]]
ARMS = {CLOSED: "closed loop", "replay-own": "replay, own matches", "replay-true": "replay, true matches"}
MEASURES = {
    "pose_anees_from_start": "pose ANEES", "pose_anees": "pose ANEES with the start's error", "map_anees": "map ANEES",
    "ate_m": "path error", "wall_rmse_m": "wall error", "wall_shape_m": "wall error, map aligned",
    "heading_rmse_rad": "heading error", "path_length_m": "path length", "duplicate_lines": "duplicate walls",
    "double_entries": "duplicate walls incl. merged", "false_matches": "false matches",
    "matches_missed": "missed matches",
}  # fmt: skip
"""Names of the measures that are compared."""
COSTS = ("wall_rmse_m", "ate_m", "path_length_m", "false_matches", "duplicate_lines")
OF_STRATEGIES = ("path_length_m", "wall_rmse_m", "pose_anees_from_start")
LEAST_P = 0.001
STATES = ("driving", "finished", "failed")


def text(key: str) -> Callable[[Row], str]:
    """Return what a cell of a column of names holds."""
    return lambda row: ARMS.get(row[key], str(row[key]))


def _count(key: str) -> Callable[[Row], str]:
    return lambda row: number(row[key])


def _mean(name: str, scale: float = 1.0) -> Callable[[Row], str]:
    return lambda row: estimated(row[name], scale)


def _only_mean(name: str, scale: float = 1.0) -> Callable[[Row], str]:
    return lambda row: number(None if row.get(name) is None else scale * row[name]["mean"])


def _each_run(name: str) -> Callable[[Row], str]:
    return lambda row: number(row[name] / row["sound"] if row["sound"] and row[name] is not None else None)


def _value(name: str, scale: float = 1.0) -> Callable[[Row], str]:
    return lambda row: number(None if row[name] is None else scale * row[name])


def _reached(percent: int) -> Callable[[Row], str]:
    return lambda row: f"{row[f'reached_{percent}']} of {row['sound']}"


ESTIMATORS: Columns = {
    "estimator": text("backend"),
    "verdict": in_words,
    "scored runs": lambda row: f"{row['sound']} of {row['trials']}",
    "pose ANEES": _mean("pose_anees_from_start"),
    "map ANEES": _mean("map_anees"),
    "wall error, cm": _mean("wall_rmse_m", 100.0),
    "path error, cm": _mean("ate_m", 100.0),
    "false matches per run": _each_run("false_matches"),
    "duplicate walls per run": _each_run("duplicate_lines"),
}
CELLS: Columns = {
    "world": text("world"), "strategy": text("strategy"), "estimator": text("backend"),
    "complete": lambda row: f"{row['complete']} of {row['trials']}", "path length, m": _only_mean("path_length_m"),
    "pose ANEES": _only_mean("pose_anees_from_start"), "map ANEES": _only_mean("map_anees"),
    "wall error, cm": _only_mean("wall_rmse_m", 100.0), "path error, cm": _only_mean("ate_m", 100.0),
}  # fmt: skip
STATED: Columns = {
    "estimator": text("backend"),
    "pose ANEES, median": lambda row: number((row["pose_anees_from_start"] or {}).get("median")),
    "with the start's error": _only_mean("pose_anees"),
    "steps outside the band, %": lambda row: percent(row["steps_outside_band"]),
    "distances within their 95 % interval, %": _only_mean("distances_in_95", 100.0),
    "NIS": _only_mean("nis"),
    "scans in its band, %": _only_mean("nis_in_band", 100.0),
    "noise": lambda row: _noise(row.get("nis"), row.get("nis_in_band")),
    "least trace, of the start's": _value("trace_least"),
    "bound margin": lambda row: number(None if row["bound_margin"] is None else round(row["bound_margin"], 6)),
    "NIS of true matches": _only_mean("nis_mean"),
    "whiteness": _only_mean("nis_whiteness"),
}
ERRORS: Columns = {
    "estimator": text("backend"),
    "wall error, map aligned, cm": _only_mean("wall_shape_m", 100.0),
    "heading error, degrees": _only_mean("heading_rmse_rad", 180.0 / pi),
    "duplicate walls incl. merged": _count("double_entries"),
    "merged": _count("merges"),
    "wrong observations": _count("matches_false"),
    "missed, %": lambda row: percent(row["missed_share"] and row["missed_share"]["mean"]),
    "observations": _count("sightings"),
    "no pose ANEES": lambda row: number(row["without"].get("pose_anees_from_start", 0)),
    "no map ANEES": lambda row: number(row["without"].get("map_anees", 0)),
    "no wall error": lambda row: number(row["without"].get("wall_rmse_m", 0)),
}
EXPLORED: Columns = {
    "strategy": text("strategy"), "estimator": text("backend"),
    **{f"{percent} % seen": _reached(percent) for percent in PERCENTS},
    **{words.format(percent): _mean(f"swept_{percent}_{unit}") for percent in PERCENTS
       for unit, words in {"s": "time to {} %, s", "m": "path to {} %, m", "steps": "scans to {} %"}.items()},
}  # fmt: skip
DIFFERENCES: Columns = {
    "measure": lambda row: MEASURES[row["measure"]],
    "kind": text("kind"),
    "value": lambda row: number(row["value"], _digits(row)),
    "95 % interval": lambda row: interval(row, digits=_digits(row)) or NONE,
    "for other buildings": lambda row: interval(row, digits=_digits(row), ends=BUILDINGS) or NONE,
    "effect size": lambda row: number(row.get("effect_size")),
    "runs": _count("runs"),
    "left out": _count("pairs_without_value"),
    "p, corrected": lambda row: _probability(row.get("p_holm")),
}
MARKS: Columns = {
    "world": text("world"), "strategy": text("strategy"), "estimator": text("backend"), "metres": text("metres"),
    **{state: _count(state) for state in STATES},
    "pose error, cm": _value("pose_error_m", 100.0), "wall error, cm": _value("wall_rmse_m", 100.0),
    "pose ANEES so far": _value("pose_anees_so_far"), "coverage, %": _value("coverage", 100.0),
    "no wall error": lambda row: number(row["without"].get("wall_rmse_m", 0)),
    "no ANEES": lambda row: number(row["without"].get("pose_anees_so_far", 0)),
}  # fmt: skip


def _noise(nis: Row | None, in_band: Row | None) -> str:
    return noise_model(nis["mean"], in_band["mean"]) if nis and in_band else NONE


def _probability(p: float | None) -> str:
    return number(p, 2) if p is None or p >= LEAST_P else f"< {LEAST_P}"


def _digits(row: Row) -> int:
    """Return the number of digits that distinguish a difference and its interval from none."""
    known = [row[name] for name in ("value", "low", "high") if row.get(name) is not None]
    return digits_apart([*known, 1.0 if row["kind"].startswith("ratio") else 0.0])


def compared(row: Row | None) -> str:
    """Return a difference with its interval, with a star if it is significant."""
    value, space, more = estimated(row).partition(" ")
    return value + ("*" if row is not None and is_clear(row) else "") + space + more


def crossed(title: str, rows: Sequence[Row], names: Mapping[str, str], measures: Sequence[str]) -> PageTable:
    """Return comparisons with a column for each measure; `names` are the columns that tell rows apart, and their keys.

    Rows without any value are left out.
    """
    by: dict[tuple[str, ...], dict[str, Row]] = {}
    for row in rows:
        if row["measure"] in measures and row["value"] is not None:
            by.setdefault(tuple(row[key] for key in names.values()), {})[row["measure"]] = row
    kinds = {row["measure"]: row["kind"].partition(" ")[0] for row in rows}
    header = (*names, *(f"{MEASURES[name]}, {kinds.get(name, '')}" for name in measures), "pairs")
    shown = tuple(
        (*cell, *(compared(found.get(name)) for name in measures), number(max(row["runs"] for row in found.values())))
        for cell, found in by.items()
    )
    return PageTable(title, header, shown).filled()


def differences(title: str, rows: Iterable[Row], names: Mapping[str, str]) -> PageTable:
    """Return comparisons one by one, without those that have no value."""
    lead = {name: text(key) for name, key in names.items()}
    better = {"better in, % of runs": lambda row: percent(row["first_better"])}
    told = [row for row in rows if row["value"] is not None]
    more = better if all("first_better" in row for row in told) else {}
    return table(title, {**lead, **DIFFERENCES, **more}, told)


def without_anees(columns: Columns) -> Columns:
    """Return columns for runs without noise, which have no NEES."""
    return {name: cell for name, cell in columns.items() if "ANEES" not in name and name != "verdict"}


def marks_table(said: Row, columns: Columns = MARKS) -> PageTable:
    """Return the means at equal path lengths, for those that some run reached."""
    closed = [row for row in said["marks"] if row["arm"] == CLOSED]
    reached = {END, *(row["metres"] for row in closed if row["driving"])}
    return table("At equal path lengths, closed loop", columns, [row for row in closed if row["metres"] in reached])


def claims(arms: Sequence[str], said: Row) -> PageTable:
    """Return the claims of `comparison.json`, and whether each holds in each arm."""
    lead: Columns = {"claim": text("claim"), "estimator": text("backend")}
    return table("Claims", {**lead, **{ARMS[arm]: _holds(arm) for arm in arms}}, said["findings"])


def _holds(arm: str) -> Callable[[Row], str]:
    words = {True: "yes", False: "no", None: NONE}
    return lambda finding: words[finding["arms"].get(arm, {"holds": None})["holds"]]


def hypothesis_table(found: Row | None) -> PageTable:
    """Return the ratios of the contender's errors to the baseline's at each mark that some run reached."""
    ratios = {"wall_rmse_m": "wall error", "wall_shape_m": "wall error, map aligned", "pose_error_m": "pose error",
              "pose_anees_so_far": "pose ANEES so far"}  # fmt: skip
    columns: Columns = {
        "metres": text("metres"), **{f"{words}, ratio": _mean(key) for key, words in ratios.items()},
        "not mapped, % points more": _mean("uncovered", 100.0),
        **{f"{side}: {', '.join(STATES)}": _states(side) for side in ("contender", "baseline")},
    }  # fmt: skip
    marks = {} if found is None else found["marks"]
    reached = [{"metres": mark} | at for mark, at in marks.items() if at["wall_rmse_m"]["runs"]]
    return table("At equal path lengths", columns, reached)


def _states(side: str) -> Callable[[Row], str]:
    return lambda at: ", ".join(number(at[side][state]) for state in STATES)
