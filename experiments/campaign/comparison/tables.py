"""The tables of a campaign, made from the files of its trials in a fixed order."""

from collections.abc import Callable, Sequence
from io import BytesIO
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.sim.logs.archive import regular
from chainslam.slam.association.matching import MatchingConfig
from chainslam.slam.evaluation.consistency import chi2_band, pooled_band

from ...artifacts.files import csv_bytes, json_bytes, stamp, write
from ...artifacts.reading import read_json, told
from ...artifacts.schema import UnfitError
from ...scoring.maps.measurements import Z_95
from ..plan import Campaign, Trial, gate_of, is_errorless
from ..scores.score import END, TrialScores
from .comparison import compare
from .consistency import consistency
from .exploration import exploration
from .findings import findings
from .hypothesis import hypothesis
from .shapes import COMPARISON

FIRST = (
    *("world", "backend", "strategy", "seed", "mode", "association", "status", "reason", "steps", "path_length_m"),
    *("drive_time_s", "open_ends", "contours_closed", "contours_reachable", "lines", "coverage", "swept"),
    *("collisions", "pose_rmse_m", "heading_rmse_rad", "pose_anees", "pose_nees_in_band", "map_anees"),
    *("duplicate_lines", "false_matches", "pose_anees_from_start", "nis", "nis_in_band"),
)
"""Columns that scripts rely on; the others follow in order of first occurrence."""
TIMINGS = "step_ms_"
"""Prefixes of the columns that differ between identical runs."""
GATE = MatchingConfig().gate
"""Default level of the gate of a campaign's trials."""
KEYS = ("world", "strategy", "backend", "mode", "association")
PLAIN = (str, int, float, bool)

Row = dict[str, Any]


def trial_row(record: TrialScores, gate: float = GATE) -> Row:
    """Return the plain values of a trial's summary, and the coverage of its intervals of distances."""
    summary = record.summary
    row = {key: value for key, value in summary.items() if value is None or isinstance(value, PLAIN)}
    row.pop("traceback", None)
    row["set_aside"] = len(summary.get("set_aside") or ())
    row |= doubles(summary, gate)
    off, sigma = distance_errors(record)
    row["distances"] = len(off)
    row["distances_in_95"] = float(np.mean(np.abs(off) <= Z_95 * sigma)) if len(off) else None
    row |= {f"{TIMINGS}{key}": value for key, value in (summary.get("step_ms") or {}).items()}
    return row


def doubles(summary: Row, gate: float = GATE) -> Row:
    """Return how many observations of known walls there were, and how many duplicate walls (merged or not).

    A gate at level g refuses 1 - g of the observations of a calibrated estimate, each of which may enter a wall anew:
    `doubles_beyond_gate` is the number of duplicate walls less that.
    """
    names = ("matches_true", "matches_missed", "matches_false", "duplicate_lines", "merges", "false_merges")
    found: dict[str, int] = {name: summary[name] for name in names if summary.get(name) is not None}
    if len(found) < len(names):
        return {"sightings": None, "missed_share": None, "double_entries": None, "doubles_beyond_gate": None}
    seen = found["matches_true"] + found["matches_missed"] + found["matches_false"]
    entries = found["duplicate_lines"] + found["merges"] - found["false_merges"]
    return {
        "sightings": seen,
        "missed_share": found["matches_missed"] / seen if seen else None,
        "double_entries": entries,
        "doubles_beyond_gate": entries - (1.0 - gate) * seen,
    }


def distance_errors(record: TrialScores) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Return mapped less true distance, and its standard deviation, for all pairs of known corners of a trial, m."""
    names = ("distance_m", "distance_true_m", "distance_sigma_m")
    mapped, true, sigma = (record.arrays.get(name, np.zeros(0)) for name in names)
    return mapped - true, sigma


def mark_rows(record: TrialScores) -> list[Row]:
    """Return the scores of a trial at equal metres driven.

    `state` tells what the robot was doing then: `driving` (also at the end of a run that a limit ended), `finished`
    (complete before; its last state counts) or `failed` (it ended before without being complete, and there is nothing
    to score).
    """
    summary = record.summary
    marks = summary.get("marks") or {}
    names = {key: summary[key] for key in (*KEYS, "seed", "status")}
    complete = summary["status"] == "complete"
    rows = []
    for mark in ("10", "20", "33", END):
        at = marks.get(mark)
        state = "driving" if at is not None else "finished" if complete else "failed"
        if mark == END:
            state = {"complete": "finished", "stopped": "driving"}.get(summary["status"], "failed")
        scores = at if at is not None else marks.get(END) if complete else None
        rows.append({**names, "metres": mark, "state": state, **(scores or {})})
    return rows


def step_rows(records: Sequence[TrialScores]) -> list[Row]:
    """Return the statistics of one combination over its trials at each step, as long as a trial lasts."""
    longest = max((len(r.arrays.get("pose_nees", ())) for r in records), default=0)
    names = (
        *("path_length_m", "pose_nees", "pose_nees_from_start", "pose_trace"),
        *("pose_error_m", "heading_error_rad", "heading_sigma_rad"),
    )
    stacked = {name: np.full((len(records), longest), np.nan) for name in names}
    for row, record in enumerate(records):
        for name in names:
            values = record.arrays.get(name, np.zeros(0))
            stacked[name][row, : len(values)] = values
    going = np.isfinite(stacked["path_length_m"])
    rows = []
    for k in range(longest):
        column = {name: stacked[name][going[:, k], k] for name in names}
        nees = column["pose_nees"][np.isfinite(column["pose_nees"])]
        relative = column["pose_nees_from_start"][np.isfinite(column["pose_nees_from_start"])]
        low, high = chi2_band(3, runs=max(len(nees), 1))
        anees = float(nees.mean()) / 3.0 if len(nees) else None
        rows.append(
            {
                **{key: records[0].summary[key] for key in KEYS},
                "step": k,
                "trials": int(going[:, k].sum()),
                "without_nees": int(going[:, k].sum()) - len(nees),
                "path_length_m": float(column["path_length_m"].mean()),
                "pose_anees": anees,
                "pose_anees_from_start": float(relative.mean()) / 3.0 if len(relative) else None,
                "band_low": low / 3.0,
                "band_high": high / 3.0,
                "pose_nees_median": float(np.median(nees)) if len(nees) else None,
                "pose_error_rms_m": float(np.sqrt(np.mean(column["pose_error_m"] ** 2))),
                "heading_error_rms_rad": float(np.sqrt(np.mean(column["heading_error_rad"] ** 2))),
                "heading_sigma_rms_rad": float(np.sqrt(np.mean(column["heading_sigma_rad"] ** 2))),
                "pose_trace": float(column["pose_trace"].mean()),
            }
        )
    return rows


def parquet_bytes(rows: Sequence[Row], header: Sequence[str]) -> bytes:
    """Return a table as Parquet, the same bytes for the same rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    buffer = BytesIO()
    columns = {name: pa.array([row.get(name) for row in rows]) for name in header}
    pq.write_table(pa.table(columns), buffer)
    return buffer.getvalue()


def header_of(rows: Sequence[Row], first: Sequence[str] = ()) -> list[str]:
    """Return the names of all columns, in order of first occurrence."""
    return list(dict.fromkeys((*first, *(key for row in rows for key in row))))


def write_table(path: Path, rows: Sequence[Row], first: Sequence[str] = ()) -> None:
    """Write one table as CSV and as Parquet."""
    header = header_of(rows, first)
    write(path.with_suffix(".csv"), csv_bytes(header, [[row.get(key) for key in header] for row in rows]))
    write(path.with_suffix(".parquet"), parquet_bytes(rows, header))


def read_rows(path: Path, columns: Sequence[str] = ()) -> list[Row]:
    """Return the rows of a Parquet table; raises UsageError for another file or missing `columns`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with told(path, "run the same `compare` to its end"):
        try:
            table = pq.read_table(regular(path), partitioning=None)
            missing = [name for name in columns if name not in table.column_names]
            rows: list[Row] = [] if missing else table.to_pylist()
        except (pa.ArrowException, ValueError, TypeError) as error:
            raise UnfitError("no table, or one that was cut short") from error
        if missing:
            raise UnfitError(f"no column {missing[0]}")
    return rows


def read_comparison(folder: Path) -> Row:
    """Return `comparison.json` of a campaign's folder, with the verdicts that an older one lacks; raises UsageError."""
    said: Row = read_json(folder / "comparison.json", COMPARISON, "run the same `compare` to its end")
    return said | {"pooled": [row | consistency(row) for row in said["pooled"]]}


def band_scores(records: Sequence[TrialScores], steps: Sequence[Row]) -> Row:
    """Return the number of steps outside their band in a combination, and the band of all steps together."""
    outside = [row["pose_anees"] < row["band_low"] or row["pose_anees"] > row["band_high"]
               for row in steps if row["pose_anees"] is not None]  # fmt: skip
    runs = [r.arrays["pose_nees"] for r in records if np.all(np.isfinite(r.arrays.get("pose_nees", [np.nan])))]
    low, high = pooled_band(runs, 3) if runs else (None, None)
    return {
        "steps_outside_band": float(np.mean(outside)) if outside else None,
        "pooled_anees": float(np.mean([run.mean() for run in runs])) / 3.0 if runs else None,
        "pooled_low": low,
        "pooled_high": high,
    }


def write_tables(
    folder: Path, campaign: Campaign, trials: Sequence[Trial], record_of: Callable[[Trial], TrialScores]
) -> Row:
    """Write every table of some trials, which stand cell by cell, and return what they say: `comparison.json`.

    `campaign` names the levels.
    """
    rows, marks, steps, bands = [], [], [], []
    gate = gate_of(campaign)
    for _, cell in groupby(trials, key=lambda t: (t.world, t.strategy, t.backend, t.arm)):
        records = [record_of(trial) for trial in cell]
        rows += [trial_row(record, gate) for record in records]
        marks += [row for record in records for row in mark_rows(record)]
        mine = step_rows(records)
        steps += mine
        bands.append(band_scores(records, mine))
    write_table(folder / "trials", rows, FIRST)
    write_table(folder / "marks", marks)
    write_table(folder / "steps", steps)
    said = compare(campaign, rows, marks, bands)
    claims = [] if is_errorless(campaign) else findings(said["pooled"], gate)
    said |= {**stamp(), "hypothesis": hypothesis(marks), "findings": claims, "exploration": exploration(rows)}
    write(folder / "comparison.json", json_bytes(said))
    return said
