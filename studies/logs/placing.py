"""The second half of a log in the map of the first, and in the map of another building, where it has no place.

.venv/bin/python -m studies.logs.placing --logs DIR     # goes on where it was interrupted

DIR holds `NAME.log.gz` and `NAME.ref_gmapping.txt`, which tells where the halves lie to each other.
"""

import gzip
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.artifacts.results import write_results
from chainslam.experiments.artifacts.trajectories import smoothed_path
from chainslam.experiments.library.later_logs import placed_real
from chainslam.experiments.replays.real_log import RealOptions, RealRun, read_real_run, replay_real
from chainslam.experiments.replays.sources import RealLog
from chainslam.experiments.scenario import OFFLINE
from chainslam.experiments.scoring.trajectories import alignment_of_paths, ate
from chainslam.experiments.scoring.without_truth.references import read_references
from chainslam.experiments.scoring.without_truth.relations import paired_poses
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import TrialResult
from chainslam.slam.geometry.poses import compose, inverse

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.tables import headed

SCAN = b"FLASER"
NAMES = ("map", "log")
HEAD = (
    "first half of", "second half of", "places", "off by: m, degrees", "sigma: m, m, degrees",
    "gmapping's fit to the halves, m rms",
)  # fmt: skip


@dataclass(frozen=True)
class PlacingStudy:
    """Place the second half of each log in the map of the first half of each, and print a row for each pair."""

    logs: Path
    """Folder with the logs."""
    names: tuple[str, ...] = ("intel", "aces", "seattle")
    """The logs."""
    out: Path = Path("results/placing.jsonl")
    """A line of JSON for each pair, as it ends. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        tasks = [(pair, [pair]) for pair in product(self.names, repeat=2)]
        plain_console(width=150).print(table(list(rows_of(self.out, NAMES, tasks, partial(_one, self.logs), 1))))


def _one(logs: Path, pair: tuple[str, str]) -> list[Row]:
    with TemporaryDirectory() as home:
        first, second = (half_of(logs / f"{name}.log.gz", k, Path(home)) for k, name in enumerate(pair))
        mapped, folder = replay_real(first, OFFLINE), Path(home) / "map"
        folder.mkdir()
        write_results(mapped, folder, RealLog(first).config(OFFLINE))
        _, told = placed_real(RealLog(second), folder)
    row: Row = dict(zip(NAMES, pair, strict=True)) | {"places": len(told["places_world"])}
    if pair[0] == pair[1] and row["places"] == 1:
        halves = [_against(logs, pair[0], each) for each in (mapped, replay_real(second, OFFLINE))]
        true = compose(inverse(halves[0][0]), halves[1][0])
        off = compose(inverse(true), np.array(told["places_world"][0]))
        row |= {"off": off.tolist(), "sigma": np.sqrt(np.diag(told["place_covs"][0])).tolist()}
        row |= {"fit_m": [fit_m for _, fit_m in halves]}
    return [row]


def half_of(log: Path, number: int, home: Path) -> RealRun:
    """Return the first (0) or second (1) half of a packed log, cut at its middle scan and written into `home`."""
    lines = gzip.decompress(log.read_bytes()).splitlines(keepends=True)
    scans = [k for k, line in enumerate(lines) if line.startswith(SCAN)]
    begin, end = list(pairwise((0, scans[len(scans) // 2], len(lines))))[number]
    half = home / f"{number}-{log.stem}"
    half.write_bytes(b"".join(lines[begin:end]))
    return read_real_run(half, RealOptions(), None, {}, {})


def _against(logs: Path, name: str, half: TrialResult) -> tuple[Float[np.ndarray, "3"], float]:
    """Return the motion that brings a refined half nearest to its path by gmapping, and how far it is off then, m."""
    reference = read_references(None, logs / f"{name}.ref_gmapping.txt").path
    assert half.log is not None
    assert half.smoothed is not None
    assert reference is not None
    ours, theirs = paired_poses(*smoothed_path(half, half.log, half.smoothed), *reference)
    return alignment_of_paths(ours, theirs), ate(ours, theirs, align=True)


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each pair; of two buildings there is no place to be off from."""
    shown = headed("Halves of logs placed in saved maps", HEAD, 2)
    for row in rows:
        cells = ["-"] * 3
        if "off" in row:
            (x, y, turn), (sx, sy, sturn) = row["off"], row["sigma"]
            cells = [
                f"{np.hypot(x, y):.2f}, {abs(np.rad2deg(turn)):.1f}",
                f"{sx:.2f}, {sy:.2f}, {np.rad2deg(sturn):.1f}",
            ]
            cells += [", ".join(f"{fit_m:.2f}" for fit_m in row["fit_m"])]
        shown.add_row(row["map"], row["log"], str(row["places"]), *cells)
    return shown


if __name__ == "__main__":
    run_study(PlacingStudy)
