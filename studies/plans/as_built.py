"""How many walls that stand elsewhere than drawn are found, and how often one is called moved that is not.

The drawing is changed in place of the building, so that one drive serves for many drawings.

.venv/bin/python -m studies.plans.as_built --plans DIR     # explores what `studies.plans.dimensions` has not
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.scenario import load_world
from chainslam.experiments.scoring.maps.measurements import Z_95
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.views.plans.against.alignment import align
from chainslam.experiments.views.plans.against.built import Finding, Verdict, compare
from chainslam.experiments.views.plans.faces import read_faces
from chainslam.slam.geometry.lines import directions, normals, through

from ..runner.command import run_study
from .moved_walls import Moved, with_moved
from .runs import as_drawn, explored, plans_in

BANDS_MM = (10, 15, 20, 40, 100)


@dataclass(frozen=True)
class Checked:
    """What was said of one face of one drawing."""

    drawing: tuple[str, int]
    """The plan, and which drawing of it; 0 is as it was built."""
    finding: Finding
    true_m: float
    """By how much it really stands elsewhere."""


@dataclass(frozen=True)
class AsBuiltStudy:
    """Explore apartments, compare each map with drawings of which faces are moved, and print what is found."""

    plans: Path = Path("../shared/data/plans")
    """A folder of maps."""
    named: str = "lifull_*"
    """Which files of the folder, as the shell would write it."""
    count: int = 40
    """How many of them, in alphabetical order."""
    drawings: int = 3
    """Drawings of each in which faces are moved."""
    moved: int = 2
    """How many faces, at most."""
    tolerances: tuple[float, ...] = (0.0, 0.01)
    """m."""
    false_alarms: float = 0.05
    """Chance that any face of a drawing is called moved though none is."""
    backend: str = "invariant-ekf"
    """The estimator."""
    seed: int = 1
    """Seed of each run."""
    anywhere: bool = False
    """Match the map without being told where it lies in the drawing."""
    jobs: int = 2
    """Number of processes."""
    runs: Path = Path("results/plans")
    """Folder of the runs."""

    def run(self) -> None:
        """Explore what is to be explored and print the tables; raises UsageError."""
        plans = plans_in(self.plans, self.named, self.count)
        folders = explored(plans, self.backend, self.seed, self.runs, self.jobs, as_drawn)
        for tolerance in self.tolerances:
            rows = [
                row
                for plan, folder in zip(plans, folders, strict=True)
                for row in self._checked(plan, folder, tolerance)
            ]
            plain_console(width=150).print(table(rows, tolerance))

    def _checked(self, plan: Path, folder: Path, tolerance: float) -> list[Checked]:
        world, faces = load_world(str(plan)), read_faces(folder)
        rows = []
        for number in range(self.drawings + 1):
            drawn, moved = with_moved(world, self.moved, number) if number else (world, ())
            pose = align(faces, drawn.faces, None if self.anywhere else np.zeros(3))
            found = compare(
                faces, drawn.faces, pose, tolerance, self.false_alarms, np.zeros(len(drawn.faces), dtype=bool)
            )
            rows += [
                Checked((plan.stem, number), each, _true(drawn.faces[each.face], moved, world.faces))
                for each in found.findings if each.verdict is not Verdict.EXTRA
            ]  # fmt: skip
        return rows


def _true(face: np.ndarray, moved: Sequence[Moved], built: np.ndarray) -> float:
    """Return how far a face of a changed drawing is from where it was built."""
    alpha = through(face[None])[0, 0]
    for each in moved:
        to = built[each.face].mean(axis=0) - face[0]
        is_it = abs(to @ normals(alpha) + each.by_m) < 1e-4 and 0.0 < to @ directions(alpha) < np.hypot(
            *(face[1] - face[0])
        )
        if is_it and np.cos(through(built[each.face][None])[0, 0] - alpha) > 0.999:
            return -each.by_m
    return 0.0


def table(rows: Sequence[Checked], tolerance: float) -> Table:
    """Return how many are found of the moved faces, by how far they are moved, and how many false alarms there are."""
    shown = Table(title=f"tolerance {1e3 * tolerance:g} mm", title_justify="left")
    for column in ("faces", "count", "called moved", "95 % interval of the shift holds", "error mm, median"):
        shown.add_column(column, justify="left" if column == "faces" else "right")
    for low, high in pairwise(BANDS_MM):
        _add(shown, f"moved by {low} to {high} mm", [row for row in rows if low <= 1e3 * abs(row.true_m) < high + 1e-9])
    for name, is_as_built in (
        ("where they are drawn, no other moved", True),
        ("where they are drawn, others moved", False),
    ):
        group = [row for row in rows if row.true_m == 0.0 and (row.drawing[1] == 0) == is_as_built]
        _add(shown, name, group)
        drawings = {row.drawing for row in group}
        alarmed = {row.drawing for row in group if row.finding.verdict is Verdict.MOVED}
        shown.add_row("  drawings with a false alarm", f"{len(drawings)}", f"{len(alarmed)}", "", "")
    return shown


def _add(shown: Table, name: str, group: Sequence[Checked]) -> None:
    known = [(row.finding.shift, row.true_m) for row in group]
    off = np.array([abs(shift.value - true) for shift, true in known if shift is not None])
    sigmas = np.array([shift.sigma for shift, _ in known if shift is not None])
    holds = f"{np.mean(off <= Z_95 * sigmas):.3f}" if len(off) else "-"
    called = sum(row.finding.verdict is Verdict.MOVED for row in group)
    shown.add_row(name, str(len(group)), str(called), holds, f"{1e3 * np.median(off):.2f}" if len(off) else "-")


if __name__ == "__main__":
    run_study(AsBuiltStudy)
