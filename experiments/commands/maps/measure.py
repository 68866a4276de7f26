"""`chainslam measure`: distances, lengths and areas of a map, with error bars."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.table import Table

from ...artifacts.maps.mapped import MappedCorners, read_corners
from ...artifacts.saved import read_config
from ...scoring.maps.measurements import Measured
from ...terminal.answers import found
from ...terminal.console import plain_console
from ...usage import UsageError
from ...views.plans.faces import END_SIGMA_M
from ...views.plans.records import (
    HEAD,
    RELATED,
    ROUGH,
    dimension_record,
    dimension_rows,
    direction_record,
    named,
    structure_record,
    structure_rows,
)
from ...views.plans.structure import needs_structure, structured_at
from ...views.plans.survey import Survey, survey_at


@dataclass(frozen=True)
class Measure:
    """Measure the distance between two corners of a run's map with its 95 % interval; without corners, list all."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder of a run."""
    corners: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="CORNER")] = ()
    """Two corners, by their ids in map.geojson."""
    structure: bool = False
    """List which walls are parallel, square, collinear or equally thick, how probable each is, and the dimensions once
    the sure ones are imposed."""
    tolerance_deg: Annotated[float | None, tyro.conf.arg(metavar="DEGREES")] = None
    """Standard deviation of such walls from square; by default it is estimated from the map."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError for names that are no corners."""
        needs_structure(self.structure, self.tolerance_deg)
        if self.structure and self.corners:
            raise UsageError("expected no corners with --structure, found some: leave out one of the two")
        if self.structure:
            _list_structure(self.folder, self.tolerance_deg)
            return 0
        mapped = read_corners(self.folder)
        if len(self.corners) not in (0, 2):
            raise UsageError(f"expected two corners or none, found {len(self.corners)}: name two from the list")
        if not self.corners:
            _list(mapped, self.folder)
            return 0
        first, second = (mapped.named(name, self.folder) for name in self.corners)
        measured = mapped.distance(first, second)
        low, high = measured.interval
        found(distance_m=measured.value, sigma_m=measured.sigma, interval_m=[low, high])
        print(
            f"corner {first} to corner {second}: {measured.value:.3f} m, 95 % interval {low:.3f} to {high:.3f} m"
            f" (sigma {1e3 * measured.sigma:.1f} mm{_estimator(self.folder)})"
        )
        return 0


def _list(mapped: MappedCorners, folder: Path) -> None:
    console = plain_console(width=None)
    found(
        corners=[_corner_record(mapped, k) for k in range(len(mapped))],
        rooms=[_room_record(mapped, room) for room in mapped.rooms],
    )
    measured = survey_at(folder)
    corners = Table(title=f"corners of {folder}{_estimator(folder)}", title_justify="left")
    for title in ("corner", "x m", "y m", "sigma mm", "walls", "chain"):
        corners.add_column(title, justify="right")
    for k, walls in enumerate(mapped.walls):
        x, y = mapped.points.positions_world[k]
        spread = 1e3 * max(mapped.points.cov[k, 0, k, 0] + mapped.points.cov[k, 1, k, 1], 0.0) ** 0.5
        sigma = f"{spread:.1f}" if mapped.sharp[k] else "collinear"
        corners.add_row(str(k), f"{x:.3f}", f"{y:.3f}", sigma, f"{walls[0]}, {walls[1]}", str(mapped.chains[k]))
    console.print(corners)
    if mapped.rooms:
        _list_chains(mapped, console)
    else:
        print("no chain is closed")
    _list_dimensions(measured, console, "dimensions, `chainslam plan` draws them")


def _list_structure(folder: Path, tolerance_deg: float | None) -> None:
    structure, measured = structured_at(folder, tolerance_deg)
    found(structure=structure_record(structure))
    console = plain_console(width=None)
    relations = Table(title=f"relations of walls{_estimator(folder)}", title_justify="left")
    for title in RELATED:
        relations.add_column(title, justify="right" if title == "probability" else "left")
    for row in structure_rows(structure):
        relations.add_row(*row)
    if structure.hypotheses:
        console.print(relations)
    print(structure.words)
    _list_dimensions(measured, console, "dimensions with the sure relations")


def _list_dimensions(measured: Survey, console: Console, title: str) -> None:
    found(
        dimensions=[dimension_record(measured, name, each) for name, each in named(measured)],
        main_direction=direction_record(measured),
    )
    dimensions = Table(title=title, title_justify="left")
    for name in HEAD:
        dimensions.add_column(name, justify="right" if name == HEAD[1] else "left")
    for row in dimension_rows(measured):
        dimensions.add_row(*row)
    console.print(dimensions)
    if not all(each.is_firm for each in measured.dimensions):
        print(f"{ROUGH} an end without a corner, taken to be known to {100 * END_SIGMA_M:g} cm (1 sigma)")


def _list_chains(mapped: MappedCorners, console: Console) -> None:
    rooms = Table(title="closed chains, value and 95 % interval", title_justify="left")
    for title in ("chain", "is", "corners", "area m²", "length m"):
        rooms.add_column(title, justify="left" if title == "is" else "right")
    for room in mapped.rooms:
        kind = "island" if room.is_island else "room"
        values = (_words(mapped.area(room)), _words(mapped.perimeter(room)))
        rooms.add_row(str(room.chain), kind, str(len(room.corners)), *values)
    console.print(rooms)


def _corner_record(mapped: MappedCorners, k: int) -> dict[str, Any]:
    cov = mapped.points.cov[k, :, k] if mapped.sharp[k] else None
    return {
        "corner": k, "position_m": mapped.points.positions_world[k], "cov_m2": cov, "walls": list(mapped.walls[k]),
        "chain": mapped.chains[k],
    }  # fmt: skip


def _room_record(mapped: MappedCorners, room: Any) -> dict[str, Any]:
    area, length = mapped.area(room), mapped.perimeter(room)
    return {
        "chain": room.chain, "is_island": room.is_island, "corners": len(room.corners),
        "area_m2": area.value, "area_interval_m2": list(area.interval),
        "length_m": length.value, "length_interval_m": list(length.interval),
    }  # fmt: skip


def _words(measured: Measured) -> str:
    return f"{measured.value:.3f} ± {measured.interval[1] - measured.value:.3f}"


def _estimator(folder: Path) -> str:
    """Return which estimator reports the intervals; nothing if the folder does not say."""
    config = folder / "config.json"
    return f", reported by {read_config(config).trial.backend}" if os.path.lexists(config) else ""
