"""Two sessions in each of many apartments: whether the second finds its place, and how consistent the map of both is.

.venv/bin/python -m studies.plans.sessions --plans DIR     # goes on where it was interrupted
"""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from rich.table import Table

from chainslam.experiments.library.driving import begin
from chainslam.experiments.scenario import TrialConfig, load_world
from chainslam.experiments.terminal.console import plain_console
from chainslam.explore.step import Step
from chainslam.slam.geometry.poses import wrap

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from ..runner.scores import interval_words
from ..runner.tables import headed
from .runs import as_drawn, explored, plans_in

RIGHT_M, RIGHT_RAD = 0.3, np.deg2rad(5.0)
"""A place is right if it is no farther off."""
MARGIN_M = 0.05
"""The second session starts with so much room around the robot, at least."""
HEAD = (
    "back end", "plans", "place: right, wrong", "several places, none", "scans until placed, median",
    "place off by, cm: median, most", "map ANEES of both: mean, median", "pose ANEES of the second: mean, median",
)  # fmt: skip


@dataclass(frozen=True)
class SessionStudy:
    """Explore apartments twice, the second time from elsewhere with the map of the first, and print what came of it."""

    plans: Path = Path("../shared/data/plans")
    """A folder of maps."""
    named: str = "lifull_*"
    """Which files of the folder, as the shell would write it."""
    count: int = 40
    """How many of them, in alphabetical order."""
    backend: str = "invariant-ekf"
    """The estimator."""
    jobs: int = 2
    """Number of processes."""
    runs: Path = Path("results/plans")
    """Folder of the runs of the first sessions; those that are there are not driven again."""
    out: Path = Path("studies/results/rows/sessions.jsonl")
    """A line of JSON for each apartment. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Explore what is to be explored and print the table; raises UsageError."""
        plans = plans_in(self.plans, self.named, self.count)
        tasks = [((plan, self.backend, self.runs), [(plan.stem, self.backend)]) for plan in plans]
        rows = rows_of(self.out, ("plan", "backend"), tasks, _both, self.jobs)
        plain_console(width=170).print(table(list(rows)))


def _both(task: tuple[Path, str, Path]) -> Sequence[Row]:
    """Return the row of a second session, which starts anywhere on the floor that the robot can reach."""
    plan, backend, runs = task
    [first] = explored([plan], backend, 1, runs, 1, as_drawn)
    world, chance = load_world(str(plan)), np.random.default_rng(int(plan.stem.split("_")[1], 16))
    room = world.reachable().buffer(-MARGIN_M)
    while not shapely.contains_xy(room, *(place := chance.uniform(room.bounds[:2], room.bounds[2:]))):
        pass
    start = (*map(float, place), float(chance.uniform(-np.pi, np.pi)))
    trial = TrialConfig(str(plan), backend, seed=2, start=start, map=str(first))
    folder = runs / f"{plan.stem}-{backend}-2"
    driven = begin(trial, load_world(str(plan), start), folder, True, lambda scenario: nullcontext(_unwatched))
    said, log = driven.result.summary, driven.result.log
    row: Row = {"plan": plan.stem, "backend": backend}
    row |= {key: said[key] for key in ("status", "steps", "coverage", "map_anees", "duplicate_lines", "false_matches")}
    row |= {key: said["session"][key] for key in ("first_step", "placed_at_step")}
    row |= {"places": len(said["session"]["places_world"]), "pose_anees": said["session"].get("pose_anees")}
    row |= {"pose_anees_from_start": said["pose_anees_from_start"]}
    if row["first_step"] and log is not None:
        off = np.array(said["session"]["places_world"][0]) - log.true_world[row["placed_at_step"]]
        row |= {"off_m": float(np.hypot(*off[:2])), "off_rad": float(abs(wrap(off[2])))}
    return [row]


def _unwatched(step: Step) -> None:
    """Take no notice of a step."""


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each back end: how many second sessions found their place, and the scores of the map of both."""
    shown = headed("Second sessions", HEAD)
    for backend in dict.fromkeys(row["backend"] for row in rows):
        shown.add_row(f"`{backend}`", *_cells([row for row in rows if row["backend"] == backend]))
    return shown


def _cells(rows: Sequence[Row]) -> list[str]:
    placed, lost = ([row for row in rows if bool(row["first_step"]) is found] for found in (True, False))
    right = [row for row in placed if row["off_m"] < RIGHT_M and row["off_rad"] < RIGHT_RAD]
    several = sum(row["places"] > 1 for row in lost)
    scans = [row["placed_at_step"] - row["first_step"] + 1 for row in placed]
    off_cm = [100 * row["off_m"] for row in right]
    return [
        str(len(rows)),
        f"{len(right)}, {len(placed) - len(right)}",
        f"{several}, {len(lost) - several}",
        f"{np.median(scans):.0f}" if placed else "-",
        f"{np.median(off_cm):.1f}, {max(off_cm):.1f}" if right else "-",
        *(_score(placed, name) for name in ("map_anees", "pose_anees")),
    ]


def _score(rows: Sequence[Row], name: str) -> str:
    """Return the mean of a score, the 95 % interval of that mean, and the median."""
    values = np.array([row[name] for row in rows if row[name] is not None], dtype=np.float64)
    return f"{values.mean():.2f} {interval_words(values, 2)}, {np.median(values):.2f}" if len(values) else "-"


if __name__ == "__main__":
    run_study(SessionStudy)
