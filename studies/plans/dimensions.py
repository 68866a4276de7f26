"""Which share of the 95 % intervals of a plan's dimensions holds the true ones, kind by kind, over many apartments.

.venv/bin/python -m studies.plans.dimensions --plans DIR     # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.table import Table

from chainslam.experiments.scoring.maps.measurements import Z_95
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.views.plans.faces import read_faces, read_solid
from chainslam.experiments.views.plans.measuring import Kind, commonest
from chainslam.experiments.views.plans.survey import survey

from ..runner.command import run_study
from ..runner.rows import Row
from ..runner.scores import interval_words
from .runs import as_drawn, explored, plans_in
from .truth import true_value, with_truth

ALL, DIRECTION = "all lengths", "direction"


@dataclass(frozen=True)
class DimensionStudy:
    """Explore apartments, and print which share of the intervals of their dimensions holds the truth."""

    plans: Path = Path("../shared/data/plans")
    """A folder of maps."""
    named: str = "lifull_*"
    """Which files of the folder, as the shell would write it."""
    count: int = 40
    """How many of them, in alphabetical order."""
    backend: str = "invariant-ekf"
    """The estimator."""
    seed: int = 1
    """Seed of each run."""
    jobs: int = 2
    """Number of processes."""
    runs: Path = Path("results/plans")
    """Folder of the runs. What it holds is measured, and not driven, again: remove it once the mapper changed."""

    def run(self) -> None:
        """Explore what is to be explored and print the table; raises UsageError."""
        plans = plans_in(self.plans, self.named, self.count)
        folders = explored(plans, self.backend, self.seed, self.runs, self.jobs, as_drawn)
        plain_console(width=150).print(table([row for folder in folders for row in scores(folder)]))


def scores(folder: Path) -> list[Row]:
    """Return a row for each dimension of a run: its value and sigma, the true value, and whether its corners exist."""
    faces = read_faces(folder)
    with np.load(folder / "map.npz") as walls, np.load(folder / "log.npz") as log:
        of = dict(zip(walls["ids"].tolist(), walls["true_faces_of_lines"].tolist(), strict=True))
        true_faces, labels = log["true_faces"], log["true_wall_of_face"]
    face_of = np.array([of[wall] for wall in faces.ids.tolist()], dtype=np.int64)
    truth = with_truth(faces, face_of, true_faces, labels)
    found, known = survey(faces, read_solid(folder)), face_of >= 0
    rows = [
        {"run": folder.name, "kind": str(each.kind), "firm": each.is_firm, "value": each.measured.value,
         "sigma": each.measured.sigma, "true": true, "exists": exists}
        for each in found.dimensions for true, exists in (true_value(each, truth, faces, face_of, true_faces),)
    ]  # fmt: skip
    same = known & (commonest(faces.means[:, 0], faces.lengths_m)[1] > 0.0)  # the truth of the walls that were meant
    phi, _ = commonest(truth.means[same, 0], faces.lengths_m[same])
    direction = {"value": found.direction.value, "sigma": found.direction.sigma, "true": phi, "exists": True}
    return [*rows, {"run": folder.name, "kind": DIRECTION, "firm": True, **direction}]


def held(row: Row) -> bool:
    """Return whether an interval holds the truth; that of what does not exist holds nothing."""
    return row["true"] is not None and abs(row["value"] - row["true"]) <= Z_95 * row["sigma"]


def table(rows: Sequence[Row]) -> Table:
    """Return a row for each kind, between corners and to ends without one, with the intervals of the shares by run."""
    shown = Table(title=f"95 % intervals in {len({row['run'] for row in rows})} plans", title_justify="left")
    for column in (
        "dimension",
        "count",
        "held",
        "by plan (95 %)",
        "no such corner",
        "mean z²",
        "error mm: mean, median, p95",
        "stated mm",
    ):
        shown.add_column(column, justify="left" if column == "dimension" else "right")
    firm = [row for row in rows if row["firm"]]
    lengths = [row for row in firm if row["kind"] not in (DIRECTION, Kind.AREA)]
    groups = {ALL: lengths} | {str(kind): [row for row in firm if row["kind"] == kind] for kind in (*Kind, DIRECTION)}
    groups |= {f"{kind}, to an end": [row for row in rows if row["kind"] == kind and not row["firm"]] for kind in Kind}
    for name, group in groups.items():
        if group:
            shown.add_row(name, *_cells(group))
    return shown


def _cells(group: Sequence[Row]) -> list[str]:
    shares = [
        float(np.mean([held(row) for row in group if row["run"] == run]))
        for run in sorted({row["run"] for row in group})
    ]
    sound = [row for row in group if row["true"] is not None]
    off = np.array([row["value"] - row["true"] for row in sound])
    sigmas = np.array([row["sigma"] for row in sound])
    mean = 1e3 * float(np.sum(off / sigmas**2) / np.sum(sigmas**-2))
    errors = f"{mean:.2f}, {1e3 * np.median(np.abs(off)):.1f}, {1e3 * np.quantile(np.abs(off), 0.95):.1f}"
    return [
        str(len(group)), f"{np.mean([held(row) for row in group]):.3f}", interval_words(np.array(shares)),
        str(sum(not row["exists"] for row in group)), f"{np.mean((off / sigmas) ** 2):.2f}", errors,
        f"{1e3 * np.median(sigmas):.1f}",
    ]  # fmt: skip


if __name__ == "__main__":
    run_study(DimensionStudy)
