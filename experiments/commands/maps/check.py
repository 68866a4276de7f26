"""`chainslam check`: a building as built, by the map of a run, against as designed, by a drawing."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from rich.table import Table

from chainslam.sim.worlds import AS_DRAWN, DrawingOptions
from chainslam.slam.geometry.poses import to_world

from ...artifacts.files import replacing, write_anywhere
from ...artifacts.saved import read_config
from ...scenario import STRATEGY_OF_REPLAYS, load_world
from ...scoring.maps.measurements import Z_95
from ...terminal.answers import found
from ...terminal.console import plain_console, say
from ...usage import UsageError
from ...views.plans.against.alignment import align, saw_through
from ...views.plans.against.built import Comparison, Finding, Verdict, compare
from ...views.plans.faces import Faces, read_faces, read_solid

PICTURES = ("svg", "pdf", "png")
TOLD = (Verdict.MOVED, Verdict.MISSING, Verdict.EXTRA, Verdict.UNCLEAR)
"""What the table lists; of the others it tells how many there are."""


@dataclass(frozen=True)
class Check:
    """Compare a map with a drawing of the building: which walls are within tolerance, moved, missing or extra."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder of `explore` or `replay`."""
    plan: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="PLAN")]
    """The drawing: plan JSON, GeoJSON, SVG or DXF, or a bundled world."""
    tolerance: Annotated[float, tyro.conf.arg(metavar="METRES")] = 0.01
    """Walls may stand so far from where they are drawn."""
    false_alarms: float = 0.05
    """Chance that any wall is called moved though all are within tolerance."""
    at: Annotated[tuple[float, float, float] | None, tyro.conf.arg(metavar="X Y DEGREES")] = None
    """About where the map's frame lies in the drawing. By default the two agree for a run that explored a drawing, and
    are matched for a log."""
    start: tuple[float, ...] | None = None
    """A point of the floor that is compared, x and y in m, in place of the drawing's start."""
    out: Path | None = None
    """Write a picture: SVG, PDF or PNG, by the file's ending."""
    drawing: tyro.conf.OmitArgPrefixes[DrawingOptions] = AS_DRAWN
    """How the drawing is read."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for bad input, and where the two do not fit."""
        if not (0.0 <= self.tolerance < 1.0 and 0.0 < self.false_alarms < 1.0):
            raise UsageError(
                "expected a tolerance from 0 to 1 m and a chance of false alarms between 0 and 1, found"
                f" {self.tolerance:g} and {self.false_alarms:g}: correct them"
            )
        if self.out is not None and self.out.suffix[1:].lower() not in PICTURES:
            raise UsageError(
                f"expected a picture ending in .svg, .pdf or .png, found {self.out.name}: choose one of these"
            )
        faces, world = read_faces(self.folder), load_world(self.plan, self.start, self.drawing)
        pose = align(faces, world.faces, self._guess())
        solid = read_solid(self.folder)
        free = np.zeros(len(world.faces), dtype=bool) if solid is None else saw_through(solid, world.faces, pose)
        compared = compare(faces, world.faces, pose, self.tolerance, self.false_alarms, free)
        found(**_record(compared, faces, world.faces), tolerance_m=self.tolerance, false_alarms=self.false_alarms)
        self._print(compared, faces, world.faces)
        if solid is None:
            say("no map.yaml in the folder: a wall that is missing is told as not seen")
        if self.out is not None:
            replaced = replacing(self.out)
            write_anywhere(
                self.out,
                _picture(
                    compared,
                    faces,
                    world.faces,
                    f"{self.folder.name} against {world.name}",
                    self.out.suffix[1:].lower(),
                ),
            )
            say(f"picture in {self.out}{replaced}")
        return 0

    def _guess(self) -> np.ndarray | None:
        if self.at is not None:
            return np.array([self.at[0], self.at[1], np.deg2rad(self.at[2])])
        config = self.folder / "config.json"
        is_drive = config.exists() and read_config(config).trial.strategy != STRATEGY_OF_REPLAYS
        return np.zeros(3) if is_drive else None

    def _print(self, compared: Comparison, faces: Faces, design: np.ndarray) -> None:
        x, y, turn = compared.pose.tolist()
        sigma = np.sqrt(np.diag(compared.pose_cov)).tolist()
        say(
            f"the map's frame in the drawing: {x:.3f} {y:.3f} m, {np.rad2deg(turn):.2f} degrees (sigma {sigma[0]:.3f}"
            f" {sigma[1]:.3f} m, {np.rad2deg(sigma[2]):.2f} degrees)"
        )
        table = Table(title=f"walls of {self.plan}, tolerance {1e3 * self.tolerance:g} mm", title_justify="left")
        for title in ("wall", "from", "to", "is", "by mm, 95 % interval", "mapped", "walls of the map"):
            table.add_column(title, justify="left" if title in ("is", "walls of the map") else "right")
        for each in sorted((each for each in compared.findings if each.verdict in TOLD), key=_order):
            start, end = _line(each, compared, faces, design)
            is_extra = each.verdict is Verdict.EXTRA
            table.add_row(
                "" if is_extra else str(each.face), f"{start[0]:.2f}, {start[1]:.2f}", f"{end[0]:.2f}, {end[1]:.2f}",
                str(each.verdict), _shift(each), "" if is_extra else f"{100 * each.seen:.0f} %",
                ", ".join(str(faces.ids[row]) for row in each.walls),
            )  # fmt: skip
        if table.rows:
            plain_console(width=None).print(table)
        counts = Counter(each.verdict for each in compared.findings)
        say(", ".join(f"{counts[verdict]} {verdict}" for verdict in Verdict))
        say(f"{compared.tests} walls tested; chance of any false alarm {100 * self.false_alarms:g} % (Holm)")


def _order(each: Finding) -> int:
    return TOLD.index(each.verdict)


def _shift(each: Finding) -> str:
    """Return a shift with half its 95 % interval, mm; nothing where it is unknown."""
    return "" if each.shift is None else f"{1e3 * each.shift.value:.1f} ± {1e3 * Z_95 * each.shift.sigma:.1f}"


def _line(each: Finding, compared: Comparison, faces: Faces, design: np.ndarray) -> np.ndarray:
    return to_world(faces.ends_world[each.face], compared.pose) if each.verdict is Verdict.EXTRA else design[each.face]


def _record(compared: Comparison, faces: Faces, design: np.ndarray) -> dict[str, Any]:
    return {
        "alignment": {
            "x_m": compared.pose[0], "y_m": compared.pose[1], "heading_rad": compared.pose[2],
            "cov": compared.pose_cov,
        },
        "tests": compared.tests,
        "walls": [
            {
                "wall": None if each.verdict is Verdict.EXTRA else each.face,
                "ends_m": _line(each, compared, faces, design),
                "verdict": str(each.verdict),
                "shift_m": None if each.shift is None else each.shift.value,
                "sigma_m": None if each.shift is None else each.shift.sigma,
                "interval_m": None if each.shift is None else list(each.shift.interval),
                "mapped_share": each.seen,
                "map_walls": faces.ids[list(each.walls)],
            }
            for each in compared.findings
        ],
    }  # fmt: skip


def _picture(compared: Comparison, faces: Faces, design: np.ndarray, title: str, kind: Any) -> bytes:
    from chainslam.viz.figures.maps import saved
    from chainslam.viz.figures.plan_check import draw_check

    by: dict[str, list[np.ndarray]] = {}
    notes = []
    for each in compared.findings:
        line = _line(each, compared, faces, design)
        by.setdefault(str(each.verdict), []).append(line)
        if each.verdict is Verdict.MOVED and each.shift is not None:
            notes.append((line.mean(axis=0), f"{1e3 * each.shift.value:.0f} ± {1e3 * Z_95 * each.shift.sigma:.0f} mm"))
    walls = to_world(faces.ends_world.reshape(-1, 2), compared.pose).reshape(-1, 2, 2)
    return saved(draw_check(by, notes, list(walls), title), kind)
