"""The benchmark: worlds, seeds and settings fixed by version, one row for each estimator, and a table of such rows."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import defstruct

from chainslam.sim.logs.archive import regular
from chainslam.slam.backends import BACKENDS
from chainslam.viz.text import NONE

from ...artifacts.files import stamp
from ...artifacts.reading import parse_json, told
from ...artifacts.schema import UnfitError, many
from ...scenario import P0
from ...usage import UsageError
from ...views.numbers import BUILDINGS, interval, number
from ..plan import CLOSED, Campaign, recordings
from ..store import Store, read_config
from .tables import read_comparison, read_rows

Row = dict[str, Any]


@dataclass(frozen=True)
class Benchmark:
    """What a version fixes; a change of anything, or of what a world looks like, needs another name."""

    name: str
    worlds: tuple[str, ...]
    seeds: int
    """Trials of each world, from seed 1."""
    driver: str
    """The back end that drives the recordings."""
    max_steps: int
    """A trial that is not complete after so many scans is stopped."""
    strategy: str = "nearest-robot"
    p0: P0 = "small"


CURRENT = Benchmark(
    name="consistency-2026.1",
    worlds=("paper-fig8", "paper-fig9", "rooms", "random:1", "random:2", "random:3"),
    seeds=5,
    driver="invariant-ekf",
    max_steps=1500,
)
QUICK = Benchmark("consistency-2026.1-quick", CURRENT.worlds[:2], 2, CURRENT.driver, CURRENT.max_steps)
RECORDED = "replay-own"
ARMS = {"recorded": RECORDED, "closed": CLOSED}
"""The parts of a row: identical scans for every estimator, and the robot that acts on the estimator's own map."""
MEANS = {
    "pose_anees_from_start": "pose_anees",
    "map_anees": "map_anees",
    "ate_m": "path_error_m",
    "wall_rmse_m": "wall_error_m",
}
"""Estimates of a row, by their columns in a campaign."""
SAME = 0.1
"""Estimators whose logarithms of ANEES differ by less, 10 %, are ordered by their errors."""

ESTIMATE = defstruct("ScoreOfWorlds", [("mean", float), ("low", float | None), ("high", float | None)])
PART = defstruct(
    "BenchmarkPart",
    [
        *((name, int) for name in ("trials", "complete", "scored")),
        ("false_matches", int | None),
        ("step_ms", float | None),
        ("failures", many(dict[str, Any])),
        *((name, ESTIMATE | None) for name in MEANS.values()),
    ],
)
ROW = defstruct(
    "BenchmarkRow",
    [
        ("benchmark", str),
        ("estimator", str),
        ("estimator_version", str | None),
        ("not_citable", str | None),
        ("versions", dict[str, str]),
        ("recorded", PART),
        ("closed", PART | None),
    ],
)
"""What a row needs for the table."""


def rows_of(benchmark: Benchmark, folder: Path, campaign: Campaign) -> list[Row]:
    """Return a row for each estimator of the finished campaign in a folder; raises UsageError if files are invalid."""
    settled, pooled = read_config(folder), read_comparison(folder)["pooled"]
    trials = read_rows(folder / "trials.parquet", ("backend", "mode", "status", "step_ms_mean"))
    shared = {
        **stamp(),
        "benchmark": benchmark.name,
        "not_citable": _fault(benchmark, settled.said, settled.commit),
        "versions": settled.versions,
        "commit": settled.commit,
        "worlds": campaign.worlds,
        "seeds": list(campaign.seeds),
        "driver": campaign.driver,
        "scans_sha256": _scans(Store(folder, campaign)),
    }
    by = {(row["backend"], row["arm"]): row for row in pooled}
    found = []
    for name in campaign.backends:
        mine = [row for row in trials if row["backend"] == name]
        modes = {part: [row for row in mine if (row["mode"] == CLOSED) == (part == CLOSED)] for part in ARMS}
        runs_in = {part: by.get((name, arm)) for part, arm in ARMS.items()}
        parts = {part: pooled and _part(pooled, modes[part]) for part, pooled in runs_in.items()}
        entry = BACKENDS.get(name)
        version = None if entry is None else entry.version
        names = {"estimator": name, "estimator_version": version, "external": dict(campaign.external).get(name)}
        found.append({**shared, **names, **parts})
    return found


def read_row(line: bytes) -> Row:
    """Return the row in a line of JSON; raises UnfitError for anything else."""
    return parse_json(line, ROW)


def read_all(paths: Sequence[Path]) -> list[Row]:
    """Return the rows in some files; raises UsageError for other files, and for rows of different benchmarks."""
    rows = []
    for path in paths:
        with told(path, "name files of rows as written by `chainslam benchmark`"):
            try:
                rows += [read_row(line) for line in regular(path).read_bytes().splitlines() if line.strip()]
            except UnfitError as error:
                raise UnfitError(f"a row with {error}") from error
    names = sorted({row["benchmark"] for row in rows})
    if len(names) != 1:
        raise UsageError(f"expected rows of one benchmark, found {' and '.join(names) or 'none'}: name other files")
    return rows


def ranked(rows: Sequence[Row]) -> list[Row]:
    """Return rows with the most consistent first, then the more precise; those that lack runs stand below.

    The recorded drives decide, by the worse of pose and map; of a program that keeps no map, by the pose.
    """
    return sorted(rows, key=_rank)


def table(rows: Sequence[Row]) -> list[list[str]]:
    """Return the table of some rows, the names of its columns first; intervals are over worlds."""
    head = [
        *("estimator", "chainslam", "pose ANEES", "map ANEES", "path error, cm", "false matches", "scored"),
        *(f"closed: {name}" for name in ("pose ANEES", "path error, cm", "false matches", "complete", "step, ms")),
    ]
    return [head, *(_cells(row) for row in ranked(rows))]


def _rank(row: Row) -> tuple[bool, float, float, str]:
    part = row["recorded"]
    judged = ("pose_anees",) if row.get("external") else ("pose_anees", "map_anees")
    scores = [part[name]["mean"] if part[name] else 0.0 for name in judged]
    off = max(abs(math.log(score)) if score > 0.0 else math.inf for score in scores)
    error = part["path_error_m"]["mean"] if part["path_error_m"] else math.inf
    return part["scored"] < part["trials"], float(np.round(off / SAME)), error, row["estimator"]


def _cells(row: Row) -> list[str]:
    recorded, closed = row["recorded"], row["closed"]
    version = f" {row['estimator_version']}" if row["estimator_version"] else ""
    return [
        f"`{row['estimator']}`{version}{' (not citable)' if row['not_citable'] else ''}",
        row["versions"].get("chainslam", NONE),
        _estimate(recorded["pose_anees"]),
        _estimate(recorded["map_anees"]),
        _mean(recorded["path_error_m"], 100.0),
        number(recorded["false_matches"]),
        f"{recorded['scored']} of {recorded['trials']}",
        *([NONE] * 5 if closed is None else _closed_cells(closed)),
    ]


def _closed_cells(closed: Row) -> list[str]:
    return [
        _estimate(closed["pose_anees"]),
        _mean(closed["path_error_m"], 100.0),
        number(closed["false_matches"]),
        f"{closed['complete']} of {closed['trials']}",
        number(closed["step_ms"]),
    ]


def _mean(found: Row | None, scale: float = 1.0) -> str:
    return number(None if found is None else scale * found["mean"])


def _estimate(found: Row | None) -> str:
    within = interval(found) if found else ""
    return _mean(found) + (f" ({within})" if within else "")


def _part(pooled: Row, trials: Sequence[Row]) -> Row:
    """Return the scores of one estimator in one arm, from its row of `comparison.json` and those of its trials."""
    low, high = BUILDINGS
    estimates = {
        name: each and {"mean": each["mean"], "low": each.get(low), "high": each.get(high)}
        for name, each in ((name, pooled[column]) for column, name in MEANS.items())
    }
    times = [row["step_ms_mean"] for row in trials if row["step_ms_mean"] is not None]
    return {
        "trials": pooled["trials"],
        "complete": pooled["complete"],
        "share_complete": pooled["complete"] / pooled["trials"],
        "scored": pooled["sound"] - pooled["without"]["pose_anees_from_start"],
        **estimates,
        "false_matches": pooled["false_matches"],
        "step_ms": float(np.mean(times)) if times else None,
        "failures": [
            {name: row[name] for name in ("world", "seed", "reason")} for row in trials if row["status"] == "failed"
        ],
    }


def _fault(benchmark: Benchmark, said: Row, commit: str | None) -> str | None:
    """Return why a row cannot be cited; None if it can."""
    if benchmark != CURRENT:
        return "a try on few worlds and seeds (--quick)"
    if "resumed_with" in said:
        return "begun and continued with different versions"
    return "changed sources, of no commit" if commit is not None and commit.endswith("+") else None


def _scans(store: Store) -> str:
    """Return the SHA-256 of the ranges of all recordings: rows with the same were scored on identical scans."""
    digest = sha256()
    for recording in recordings(store.campaign):
        with np.load(regular(store.path(recording)), allow_pickle=False) as log:
            digest.update(log["ranges_m"].tobytes() if "ranges_m" in log else b"")
    return digest.hexdigest()
