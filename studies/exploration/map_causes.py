"""Which walls carry a map's error in real plans: lines over several faces, short faces, or the long straight ones.

Each plan is explored once, and its map is scored in its own gauge: all of it, with tentative walls, and without each
kind of wall.

.venv/bin/python -m studies.exploration.map_causes --plans ../shared/data/plans   # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from rich.table import Table

from experiments.scenario import TrialConfig
from experiments.scoring.association import Votes
from experiments.scoring.summary import map_error
from experiments.terminal.console import plain_console
from experiments.trial import TrialResult, run_trial
from experiments.usage import UsageError

from ..runner.command import run_study
from ..runner.rows import Row, rows_of

NAMES = ("world", "seed", "backend", "max_steps")
ONE_FACE_SHARE = 0.9
"""A line with fewer of its beams from one wall is a line over several faces."""
SHORT_M = 0.2
"""Shorter true faces are ends of walls."""


@dataclass(frozen=True)
class MapCauses:
    """Explore real plans, and print for each the map ANEES of all walls and without some of them."""

    plans: Path
    """Folder of plan files."""
    pattern: str = "cml_*.json"
    """Which files of the folder."""
    every: int = 4
    """Every so many plans by name."""
    backend: str = "invariant-ekf"
    """The estimator that drives."""
    seed: int = 1
    """Of the noise."""
    max_steps: int = 1500
    """A drive stops here."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/map-causes.jsonl")
    """A line of JSON for each plan, as it ends. What it holds of the same code is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the table; raises UsageError."""
        plans = sorted(self.plans.glob(self.pattern))[:: self.every]
        if not plans:
            raise UsageError(f"expected plan files in {self.plans}, found no {self.pattern}")
        tasks = [(plan, [(plan.stem, self.seed, self.backend, self.max_steps)]) for plan in plans]
        perform = partial(_row_of, self.backend, self.seed, self.max_steps)
        plain_console(width=130).print(table(list(rows_of(self.out, NAMES, tasks, perform, self.jobs))))


def _row_of(backend: str, seed: int, max_steps: int, plan: Path) -> list[Row]:
    result = run_trial(TrialConfig(str(plan), backend, seed=seed, max_steps=max_steps))
    known = {"world": plan.stem, "seed": seed, "backend": backend, "max_steps": max_steps}
    return [known | causes(result)]


def causes(result: TrialResult) -> Row:
    """Return the map ANEES of one run, all of it and without some walls; None for what cannot be told."""
    assert result.last is not None
    walls, votes = result.last.map, result.votes
    known = votes.walls_of(walls.ids) >= 0
    told = ~walls.tentative & known
    several = shares_of_one_wall(votes, walls.ids) < ONE_FACE_SHARE
    ends = votes.truth.faces[np.maximum(votes.faces_of(walls.ids), 0)]
    short = np.hypot(*(ends[:, 1] - ends[:, 0]).T) < SHORT_M

    def anees(among: Bool[np.ndarray, " n"]) -> float | None:
        error = map_error(votes, walls.ids, result.joint, among)
        return None if error is None else error.anees

    return {
        "lines": int(np.count_nonzero(told)),
        "of_several_faces": int(np.count_nonzero(told & several)),
        "short": int(np.count_nonzero(told & short)),
        "heading_sigma_deg": float(np.rad2deg(np.sqrt(walls.belief.pose_cov[2, 2]))),
        "map_anees": anees(told),
        "with_tentative": anees(known),
        "without_several_faces": anees(told & ~several),
        "short_alone": anees(told & short),
        "long_of_one_face": anees(told & ~short & ~several),
    }


def shares_of_one_wall(votes: Votes, ids: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return of each line the largest share of its beams that came from one wall; 1 where there were none."""
    shares = np.ones(len(ids))
    for k, line in enumerate(ids.tolist()):
        beams = votes.beams.get(line)
        if beams is not None and beams.any():
            shares[k] = np.bincount(votes.truth.walls, weights=beams).max() / beams.sum()
    return shares


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each plan."""
    shown = Table(title="Map ANEES: all walls, and without some of them", title_justify="left")
    columns = ("lines", "of_several_faces", "short", "heading_sigma_deg", "map_anees", "with_tentative",
               "without_several_faces", "short_alone", "long_of_one_face")  # fmt: skip
    for column in ("plan", *columns):
        shown.add_column(column.replace("_", " "), justify="left" if column == "plan" else "right")
    for row in rows:
        cells = (row[column] for column in columns)
        shown.add_row(row["world"], *("-" if cell is None else f"{cell:.3g}" for cell in cells))
    return shown


if __name__ == "__main__":
    run_study(MapCauses)
