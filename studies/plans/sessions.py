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
from .runs import as_drawn, explored, plans_in

RIGHT_M, RIGHT_RAD = 0.3, np.deg2rad(5.0)
"""A place is right if it is no farther off."""
MARGIN_M = 0.05
"""The second session starts with so much room around the robot, at least."""


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
    out: Path = Path("results/sessions.jsonl")
    """A line of JSON for each apartment. What it holds of the same code already is not run again."""

    def run(self) -> None:
        """Explore what is to be explored and print the table; raises UsageError."""
        plans = plans_in(self.plans, self.named, self.count)
        explored(plans, self.backend, 1, self.runs, self.jobs, as_drawn)
        tasks = [((plan, self.backend, self.runs), [(plan.stem, self.backend)]) for plan in plans]
        rows = rows_of(self.out, ("plan", "backend"), tasks, _second, self.jobs)
        plain_console(width=120).print(table(list(rows)))


def _second(task: tuple[Path, str, Path]) -> Sequence[Row]:
    """Return the row of a second session, which starts anywhere on the floor that the robot can reach."""
    plan, backend, runs = task
    world, chance = load_world(str(plan)), np.random.default_rng(int(plan.stem.split("_")[1], 16))
    room = world.reachable().buffer(-MARGIN_M)
    while not shapely.contains_xy(room, *(place := chance.uniform(room.bounds[:2], room.bounds[2:]))):
        pass
    start = (*map(float, place), float(chance.uniform(-np.pi, np.pi)))
    first = runs / f"{plan.stem}-{backend}-1"
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
    """Return how many second sessions found their place, and the scores of the map of both."""
    placed = [row for row in rows if row["first_step"]]
    right = [row for row in placed if row["off_m"] < RIGHT_M and row["off_rad"] < RIGHT_RAD]
    scans = [row["placed_at_step"] - row["first_step"] + 1 for row in placed]
    shown = Table(title=f"a second session in {len(rows)} plans", title_justify="left", show_header=False)
    shown.add_row("place right", f"{len(right)}")
    shown.add_row("place wrong", f"{len(placed) - len(right)}")
    shown.add_row("several places named", f"{sum(row['places'] > 1 for row in rows if not row['first_step'])}")
    shown.add_row("no place", f"{sum(row['places'] < 2 for row in rows if not row['first_step'])}")
    if placed:
        shown.add_row("scans until placed, median, most", f"{np.median(scans):.0f}, {max(scans)}")
        off = np.array([row["off_m"] for row in right])
        shown.add_row("off by, median, most", f"{100 * np.median(off):.1f} cm, {100 * off.max():.1f} cm")
    for key, words in (("map_anees", "map ANEES of both"), ("pose_anees", "pose ANEES of the second session"),
                       ("pose_anees_from_start", "pose ANEES from the start")):  # fmt: skip
        values = np.array([row[key] for row in placed if row[key] is not None], dtype=np.float64)
        if len(values) > 1:
            shown.add_row(words, f"{values.mean():.2f} ({interval_words(values)}), median {np.median(values):.2f}")
    complete = sum(row["status"] == "complete" for row in placed)
    shown.add_row("complete", f"{complete} of {len(placed)}")
    return shown


if __name__ == "__main__":
    run_study(SessionStudy)
