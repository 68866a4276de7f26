"""Which walls carry a map's error in real plans: lines over several faces, short faces, or the long straight ones.

Each plan is explored once, and its map is scored in its own gauge: all of it, with tentative walls, without each
kind of wall, and without the walls that carry most, one by one.

.venv/bin/python -m studies.exploration.map_causes --plans ../shared/data/plans   # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int
from rich.table import Table

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.association import Votes
from chainslam.experiments.scoring.summary import map_error
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import TrialResult, run_trial
from chainslam.experiments.usage import UsageError
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import wrap

from ..runner.command import run_study
from ..runner.rows import Row, rows_of

NAMES = ("world", "seed", "backend", "max_steps")
ONE_FACE_SHARE = 0.9
"""A line with fewer of its beams from one wall is a line over several faces."""
SHORT_M = 0.2
"""Shorter true faces are ends of walls."""
ONE_FACE_OF_SEVERAL = 0.1
"""A face with fewer of a wall's beams is not one that the wall lies over."""
WORST = 3
"""So many walls are left out, one after the other."""


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
        rows = list(rows_of(self.out, NAMES, tasks, perform, self.jobs))
        plain_console(width=130).print(table(rows), table_of_worst(rows))


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
        "worst": worst(result, told),
    }


def worst(result: TrialResult, among: Bool[np.ndarray, " n"]) -> list[Row]:
    """Return the walls without which a map's ANEES is least, one after the other, and what is left without them."""
    assert result.last is not None
    walls, votes, found = result.last.map, result.votes, list[Row]()
    for _ in range(WORST):
        tried = [
            (error.anees, row)
            for row in np.flatnonzero(among).tolist()
            if (error := map_error(votes, walls.ids, result.joint, _without(among, row))) and error.anees is not None
        ]
        if not tried:
            break
        anees, row = min(tried)
        among, wall = _without(among, row), int(walls.ids[row])
        found.append(
            {
                "wall": wall,
                "length_m": float(np.ptp(walls.extents[row])),
                "observations": int(walls.observations[row]),
                "other_faces": other_faces(votes, wall),
                "map_anees_without": anees,
            }
        )
    return found


def _without(among: Bool[np.ndarray, " n"], row: int) -> Bool[np.ndarray, " n"]:
    rest = among.copy()
    rest[row] = False
    return rest


def other_faces(votes: Votes, line: int) -> list[tuple[float, float]]:
    """Return of the faces that a wall lies over how they turn (deg) and lie aside (mm) of the one with most beams."""
    beams = votes.beams[line]
    faces = np.argsort(-beams)[: np.count_nonzero(beams >= ONE_FACE_OF_SEVERAL * beams.sum())]
    lines, middles = votes.truth.lines[faces], votes.truth.faces[faces].mean(axis=1)
    turned = np.rad2deg(wrap(lines[1:, 0] - lines[0, 0]))
    aside = 1e3 * (middles[1:] @ normals(lines[:1, 0])[0] - lines[0, 1])
    return list(zip(turned.tolist(), aside.tolist(), strict=True))


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
        shown.add_row(row["world"], *map(_cell, cells))
    return shown


def table_of_worst(rows: Sequence[Row]) -> Table:
    """Return a row for each wall that was left out, in that order."""
    shown = Table(title="The walls that carry most, left out one after the other", title_justify="left")
    columns = ("length_m", "observations", "map_anees_without")
    for column in ("plan", *columns, "other faces: deg, mm"):
        shown.add_column(column.replace("_", " "), justify="left" if column == "plan" else "right")
    for row in rows:
        for wall in row["worst"]:
            cells = (wall[column] for column in columns)
            others = "; ".join(f"{turn:.1f}, {aside:.0f}" for turn, aside in wall["other_faces"]) or "-"
            shown.add_row(row["world"], *map(_cell, cells), others)
    return shown


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


if __name__ == "__main__":
    run_study(MapCauses)
