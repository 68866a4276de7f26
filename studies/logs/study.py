"""Logs of real robots through several back ends: how far is each from what others measured.

.venv/bin/python -m studies.logs.study --logs DIR     # goes on where it was interrupted

DIR holds `NAME.log.gz`, and where others measured something `NAME.relations` and `NAME.ref_gmapping.txt`.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from chainslam.experiments.replays.measured import held_against
from chainslam.experiments.replays.real_log import RealOptions, read_real_run, replay_real
from chainslam.experiments.scenario import OdometrySource
from chainslam.experiments.scoring.without_truth.references import read_references
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.slam.backends import BACKENDS

from ..runner.command import run_study
from ..runner.rows import Row, last, read, rows_of
from ..runner.tables import headed

ROWS = Path("studies/logs/rows.jsonl")
NAMES = ("log", "backend", "odometry", "every")
HEAD = (
    "log", "back end", "odometry", "scans", "relations at scans, m", "degrees", "60 s apart, m", "interpolated, m",
    "reference, m rms", "normalised error of relations, median", "of poses, median", "poses in the 95 % band",
    "pose error, m rms: true, stated", "walls", "duplicate walls", "ms a scan", "status",
)  # fmt: skip
REFINED = "_smoothed"
"""In the names of what is scored after offline refinement."""


@dataclass(frozen=True)
class LogsStudy:
    """Map each log with each back end, and print a row for each."""

    logs: Path
    """Folder with the logs."""
    backends: tuple[str, ...] = ("full-ekf", "invariant-ekf", "block-ekf", "graph")
    """The estimators."""
    names: tuple[str, ...] = ("intel", "aces", "seattle", "dpslam_loop5")
    """The logs."""
    odometry: OdometrySource = "scans"
    """Who tells the motion between two keyframes."""
    every: int = 1
    """One of so many keyframes is mapped."""
    second_looks: bool = True
    """Whether all segments are associated anew once the drive has ended."""
    out: Path = ROWS
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        for backend in self.backends:
            if backend not in BACKENDS:
                raise UsageError(f"expected back ends out of {', '.join(BACKENDS)}, found {backend}: choose of these")
        keys = [(name, backend, self.odometry, self.every) for backend in self.backends for name in self.names]
        tasks = [(key[:2], [key]) for key in keys]
        rows = list(rows_of(self.out, NAMES, tasks, partial(_one, self), 1))
        plain_console(width=170).print(table(rows))


def _one(study: LogsStudy, task: tuple[str, str]) -> list[Row]:
    name, backend = task
    relations, path = study.logs / f"{name}.relations", study.logs / f"{name}.ref_gmapping.txt"
    references = read_references(*(file if file.is_file() else None for file in (relations, path)))
    options = RealOptions(study.every, study.odometry, study.second_looks)
    run = read_real_run(study.logs / f"{name}.log.gz", options, None, {}, {})
    began = time.process_time()
    result = held_against(replay_real(run, backend), references)
    ms = 1e3 * (time.process_time() - began) / max(len(run.log.recording), 1)
    kept = ("status", "reason", "steps", "lines", "lines_crooked", "duplicate_lines", "chains_closed", "path_length_m")
    told: dict[str, Any] = {key: result.summary[key] for key in kept}
    tails = ("", "_smoothed", "_normalised", "_smoothed_normalised")
    for key in (f"{kind}{tail}" for kind in ("relations", "reference") for tail in tails):
        if key in result.summary:
            told[key] = result.summary[key]
    of = {"log": name, "backend": backend, "odometry": study.odometry, "every": study.every}
    return [of | told | {"cpu_ms_a_scan": ms, "log_s": float(run.log.scan_time_s[-1] - run.log.scan_time_s[0])}]


def stored(path: Path) -> list[Row]:
    """Return the last row of each run, each with the last scores after offline refinement of its log.

    Refinement starts from scans and odometry alone, so that it gives the same path after any back end.
    """
    refined: dict[tuple[Any, ...], Row] = {}
    for row in read(path, NAMES, any_code=True):
        scores = {key: value for key, value in row.items() if REFINED in key}
        refined |= {_log(row): scores} if scores else {}
    rows = [row | refined.get(_log(row), {}) for row in last(path, NAMES)]
    return sorted(rows, key=lambda row: (row["log"], row["every"], list(BACKENDS).index(row["backend"])))


def _log(row: Row) -> tuple[Any, ...]:
    return row["log"], row["odometry"], row["every"]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each run and one for each refined log; what nobody measured is left out."""
    shown = headed("Logs of real robots", HEAD, 3)
    for log in dict.fromkeys(map(_log, rows)):
        own = [row for row in rows if _log(row) == log]
        for row in own:
            counts = str(row["lines"]), str(row["duplicate_lines"]), f"{row['cpu_ms_a_scan']:.0f}", row["status"]
            shown.add_row(row["log"], row["backend"], *_cells(row, ""), *counts)
        if refined := [row for row in own if any(REFINED in key for key in row)]:
            shown.add_row(log[0], "offline refinement", *_cells(refined[-1], REFINED), *["-"] * 4)
    return shown


def _cells(row: Row, tail: str) -> list[str]:
    relations, reference = row.get(f"relations{tail}"), row.get(f"reference{tail}")
    at = relations["at_scans"] if relations else None
    pairs, poses = ((row.get(f"{kind}{tail}_normalised") or {}).get("all") for kind in ("relations", "reference"))
    numbers = [
        at and at["all"]["translation_m"]["mean"],
        at and float(np.rad2deg(at["all"]["rotation_rad"]["mean"])),
        at and at["far"]["translation_m"]["mean"],
        relations and relations["interpolated"]["all"]["translation_m"]["mean"],
        reference and reference["ate_aligned_m"],
        pairs and pairs["median"],
        poses and poses["median"],
        poses and poses["in_band"],
    ]
    off = f"{poses['error_m']:.3f}, {poses['stated_m']:.3f}" if poses else "-"
    words = ("-" if number is None else f"{number:,.0f}" if number >= 1000 else f"{number:.3f}" for number in numbers)
    return [row["odometry"], str(row["steps"]), *words, off]


if __name__ == "__main__":
    run_study(LogsStudy)
